"""Joint compliance: the robot's joints give way to the load that they carry."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import ANGLES


@register
class JointCompliance(Effect):
    """Deflection of the joints by gravity, which the encoders do not see.

    Gravity turns each joint by a torque like sin 2φ cos θ, or sin 2θ cos φ, so that the flange is
    at φ + c_φ sin 2φ cos θ and θ + c_θ sin 2θ cos φ where the encoders read φ and θ. The
    error of the reading is the opposite.
    """

    name = "joint_compliance"
    family = "attitude of the rig"
    parameters = per_axis("c_joint", "rad", "c_{j%}", ANGLES)
    equation = "δφ = −c_φ sin 2φ cos θ, δθ = −c_θ sin 2θ cos φ"
    typical = (80e-6, 1.6e-3)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (−c_φ sin 2φ cos θ, −c_θ sin 2θ cos φ)."""
        (roll, pitch), (by_roll, by_pitch) = angles, p
        return (
            -by_roll * xp.sin(2 * roll) * xp.cos(pitch),
            -by_pitch * xp.sin(2 * pitch) * xp.cos(roll),
        )
