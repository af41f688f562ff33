"""What do positions on a wedge determine, and what tilt error does a calibration in them leave?"""

# --8<-- [start:compare]
import numpy as np
import wedge  # noqa: F401, to import it is to make it known

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.design.estimability import estimability
from accelstudy.leveling.error import cap_forces, tilt_error
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model

model = get_model("bias-scale-nonorthogonality")
ideal, attitudes = np.zeros(model.n_parameters), cap_forces(30 * GON, 200)
left = tilt_error(model, ideal, model, ideal, attitudes)
for name in ("wedge-8", "wedge-sides-8", "fibonacci-22"):
    for approach in ("gravity", "robot"):
        found = estimability(get_scheme(name), model, get_approach(approach))
        if found.estimable:
            roll, pitch = left.rms_of_all(found.cofactors) / MGON
            answer = f"condition {found.condition:.1f}, roll {roll:.1f}, pitch {pitch:.1f} mgon"
        else:
            answer = found.reason
        print(f"{name:13} {approach:8} {answer}")
# --8<-- [end:compare]
