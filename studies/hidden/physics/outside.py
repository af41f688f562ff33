"""Physics that was never in the catalogue of effects, as independent forward physics.

Most kinds are a function of one *coordinate* of the holds, such as the yaw, that changes one
*target*, such as the bias. That is their true place. The others are a function of no coordinate, of
two at once, or change something else: they have no place.

What nobody has foreseen was invented when the functions were fixed that a diagnosis learns, which
had been written down first.
"""

from __future__ import annotations

from collections.abc import Mapping

from studies.hidden.physics.kinds import PHASE, SEED, Kind, between, one_of, table

CYCLE = "p * (sin(TURN * part * cycles + phase) - sin(phase))"
"""Some cycles over the session, zero at its start."""

OUTSIDE = table(
    # The force of the same axis, of the next axis, of the hold before and of the next hold.
    # With fewer periods in 1 g a ripple would look like two smooth effects of the catalogue.
    Kind("ripple", "bias", "p * sin(TURN * 2.5 * f / g + phase)", "force", phase=PHASE),
    # The spring of the next axis touches its stop, whatever the sign.
    Kind("rectified_leak", "bias", "p * maximum(abs(next_axis(f)) / g - free, 0)", "force",
         free=between(0.3, 0.7)),
    # The next axis, pulled far, stiffens this one.
    Kind("transverse_gain", "scale", "p * (next_axis(f) / g) ** 4 * f", "force"),
    # Charge that the last position has left in the dielectric, whatever its sign.
    Kind("dielectric_charging", "bias", "p * (before(f) / g) ** 2", "previous"),
    Kind("tired_spring", "scale", "p * (abs(before(f)) / g) * f", "previous"),
    # The robot leaves before the mean of the hold is over.
    Kind("early_departure", "bias", "p * ((after(f) - f) / g)", "next"),
    # The attitude of the robot and its way.
    Kind("ring_magnet", "bias", "p * sin(order * roll + phase)", "angle",
         order=one_of(2.0, 3.0), phase=PHASE),
    Kind("joint_current", "scale", "p * sin(order * roll + phase) * f", "angle",
         order=one_of(2.0, 3.0), phase=PHASE),
    # The head is heavier on one side of the roll axis.
    Kind("heavy_head", "tilt", "p * sin(roll + phase)", "angle", phase=PHASE),
    Kind("encoder_third_harmonic", "reading",
         "beside(p[..., :1] * sin(3 * roll) + p[..., 1:] * cos(3 * roll), 0 * roll)", "angle"),
    Kind("slip_ring", "bias", "p * sin(order * yaw + phase)", "yaw",
         order=one_of(1.0, 2.0), phase=PHASE),
    # A cable that is wound up either way has more resistance.
    Kind("wound_supply", "scale", "p * (yaw / pi) ** 2 * f", "yaw"),
    Kind("bearing_wobble", "tilt", "p * sin(order * yaw + phase)", "yaw",
         order=one_of(2.0, 3.0), phase=PHASE),
    # The cable pulls harder the more it is wound; the encoders were zeroed at the mean pull.
    Kind("cable_drag", "deflection", "p * centred(beside(yaw, abs(yaw)))", "yaw"),
    Kind("motor_heat", "bias", "p * (way / pi) ** power", "move", power=between(1.0, 2.0)),
    Kind("sagging_base", "tilt", "p * (way / pi) ** power", "move", power=between(0.7, 1.5)),
    # A belt gives way until it is taut.
    Kind("slack_belt", "reading", "p * (-expm1(-way / taut) - 0.5)", "move",
         taut=between(1.0, 3.0)),
    # What the holds are exposed to.
    Kind("rattle", "bias", "p * exp(-(((shaking - at) / width) ** 2) / 2)", "vibration",
         at=between(0.6, 1.4), width=between(0.15, 0.35)),
    Kind("shaken_gain", "scale", "p * (shaking - 1) * f", "vibration"),
    Kind("soft_feet", "tilt", "p * (shaking - 1)", "vibration"),
    # Nothing moves up to a vibration, which shakes a coupling loose.
    Kind("loose_coupling", "reading", "p * maximum(shaking - holds, 0)", "vibration",
         holds=between(0.3, 1.0)),
    # A quartz resonator loses activity at one temperature, where another mode crosses.
    Kind("activity_dip", "bias", "p * (1 / (1 + ((in_range - at) / width) ** 2))", "temperature",
         at=between(0.2, 0.8), width=between(0.06, 0.15)),
    Kind("gain_curve", "scale", "p * (2 * (in_range - turn)) ** 2 * f", "temperature",
         turn=between(0.3, 0.7)),
    Kind("warm_pillar", "tilt", "p * since_start", "temperature"),
    Kind("warm_encoder", "reading", "p * (since_start * abs(since_start))", "temperature"),
    Kind("thermal_shock", "bias", "p * abs(rate)", "dT/dt"),
    Kind("gradient_gain", "scale", "p * rate * f", "dT/dt"),
    # One side of the pillar warms first.
    Kind("uneven_pillar", "tilt", "p * tanh(rate / most)", "dT/dt", most=between(0.5, 3.0)),
    Kind("swing", "bias", "p * sin(TURN * time / (duration * period) + phase)", "time",
         period=between(0.25, 0.6), phase=PHASE),
    Kind("scale_drift", "scale", "p * part * f", "time"),
    Kind("sinking_tripod", "tilt", "p * log1p(part / knee)", "time", knee=between(0.02, 0.3)),
    # The cabinet of the electronics is cooled and warms up in turn; zeroed at the start.
    Kind("cabinet_cycle", "reading", CYCLE, "time",
         cycles=between(1.2, 3.0), phase=between(0.0, 6.3)),
    # No place: several coordinates at once, a memory, chance, or another target.
    Kind("triple_product", "output", "p * prod(f) / g**2", typical=1e-3),
    Kind("warm_square", "output", "p * warmth() * f * f / g", typical=3e-5),
    # Each hour the cable gets tighter, and pulls at the housing as it is wound.
    Kind("tightening_cable", "bias", "p * (part * yaw / pi)"),
    # The remains of the step before the last one.
    Kind("sticking", "output", "p * before(sign(steps(f)))"),
    # A glue that yields: each hold before has a part in what it remembers.
    Kind("creep", "output", "p * memory(f, kept) / g", typical=5e-3, kept=between(0.5, 0.85)),
    # The mounting was adjusted at the mean vibration.
    Kind("shaken_mounting", "mounting", "p * centred(vibration**2)"),
    # A trap in the oxide is full or empty; it changes between two holds in one of four cases.
    Kind("telegraph_noise", "bias", "p * flips(seed, n)", seed=SEED),
    # Two clocks of which one warms up beat faster and faster.
    Kind("chirp", "bias", "p * sin(TURN * (first * n * part + more * n * part**2) + phase)",
         first=between(0.02, 0.08), more=between(0.1, 0.2), phase=PHASE),
    # A magnetic field that dips into the ground.
    Kind("room_magnet", "bias",
         "p * flange_force(joints, yaw[:, 0], array([cos(dip), 0.0, sin(dip)]))",
         dip=between(0.8, 1.3)),
)  # fmt: skip
"""Name -> kind."""

UNFORESEEN = table(
    # A bit of the converter is a little too heavy: above a level the output is higher.
    Kind("missing_code", "bias", "p * (f / g > level)", "force", level=between(-0.6, 0.6)),
    # A cooling machine in the next room runs a third of the time.
    Kind("compressor", "bias", "p * ((time / (duration / n * period) + phase) % 1 < 1 / 3)", "time",
         period=between(3.5, 9.0), phase=between(0.0, 1.0)),
    # Pressure wanders, and the lid of the sensor gives way.
    Kind("weather", "bias", "p * walk(seed, part)", "time", seed=SEED),
    Kind("reference_warm_up", "scale", "p * exp(-part / tau) * f", "time", tau=between(0.05, 0.4)),
    # Sun and clouds; it is level at the start.
    Kind("sunlit_pier", "tilt", CYCLE, "time", cycles=between(0.6, 2.5), phase=between(0.0, 6.3)),
    # Beyond an angle the brake of the roll joint drags.
    Kind("dragging_brake", "reading", "p * (abs(roll) > drags)", "angle", drags=between(0.8, 2.4)),
    # A dress pack that is pulled at both ends of its way, hardly in between.
    Kind("dress_pack", "scale", "p * (cosh(2.5 * yaw / pi) / cosh(2.5)) * f", "yaw"),
    # The gear rests on the flank that it came from, unless a joint moved by less than its play.
    Kind("backlash", "reading", "p * where(abs(moves(joints)) > 0.01, sign(moves(joints)), 0)"),
    # Small steps are followed late, large ones all but a little.
    Kind("stuck_mass", "output", "-p * steps(f) / g * exp(-((steps(f) / (free * g)) ** 2))",
         free=between(0.3, 0.8)),
    # The peaks of a vibration are cut off where the force is large already.
    Kind("overload", "output", "-p * sign(f) * maximum(abs(f) / g + 0.4 * shaking - most, 0)",
         typical=2e-2, most=between(1.0, 1.3)),
    # A package that warms goes another way than one that cools; both meet at the ends.
    Kind("thermal_loop", "bias", "p * (tanh(rate) * 4 * in_range * (1 - in_range))"),
    # The mounting turns as its glue becomes warm.
    Kind("soft_glue", "mounting", "p * since_start"),
    # Gas in the housing rises beside a wall that warms.
    Kind("convection", "output", "p * rate * last_axis(f) / g", typical=5e-3),
    # A beam that two axes share buckles the same way whatever their signs.
    Kind("buckling_beam", "output", "p * abs(f * next_axis(f)) / g**2", typical=3e-3),
    # Somebody stands on either side of the base, or is away.
    Kind("operator", "tilt", "stays(seed, n) * beside(-p[..., 1:], p[..., :1])", typical=3e-4,
         seed=SEED),
    # How it pulls depends on both angles.
    Kind("hanging_cable", "deflection",
         "p * centred(beside(sin(yaw + roll), cos(yaw - 2 * pitch)))"),
    # What it remembers is the position before the last, and how far it is from now.
    Kind("two_back", "output", "p * where(number < 2, 0, f - before(before(f))) * abs(f) / g**2"),
)  # fmt: skip
"""Name -> kind."""

NOWHERE: Mapping[str, Kind] = {**OUTSIDE, **UNFORESEEN}
"""Effects that are not in the catalogue, by name."""
