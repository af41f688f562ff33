"""The type of an array of numbers, as annotations have it; docstrings say its shape and unit."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
