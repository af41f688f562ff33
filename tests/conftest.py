"""Settings of all tests: the same examples, no clock, and angles in gon whatever the user chose."""

import os

from hypothesis import settings

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("repeatable")
os.environ.pop("ACCELSTUDY_ANGLE_UNIT", None)
