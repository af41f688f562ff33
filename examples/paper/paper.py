"""The paper in two minutes: what a robot adds to a calibration of an accelerometer.

The simulated sensor, its noise and the robot are those of Thalmann & Neuner (2018), section 4.
"""

import matplotlib.pyplot as plt
import numpy as np

# --8<-- [start:setup]
from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.leveling.error import cap_forces, tilt_error
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

model = get_model("bias-scale-nonorthogonality")
truth = model.vector(
    {"b_x": 0.05, "b_y": 0.01, "b_z": 0.03}
    | {"s_x": 200e-6, "s_y": 200e-6, "s_z": 200e-6}
    | {"alpha_yz": 12 * MGON, "alpha_zy": 12 * MGON, "alpha_zx": 44 * MGON}
)
noise = Noise(sigma_force=0.002, sigma_angle=3.2 * MGON)
simulated = session(model, truth, get_scheme("mclaren-24").directions)
# --8<-- [end:setup]

# --8<-- [start:run]
sessions = 5000
results, tilt = {}, {}
for name in ("gravity", "robot"):
    observed = simulated.draw(noise, sessions, np.random.default_rng(2018))
    results[name] = calibrate(model, get_approach(name), observed)
    estimates, attitudes = results[name].parameters, cap_forces(50 * GON, 200)
    error = tilt_error(model, truth, model, estimates.mean(axis=0), attitudes)
    tilt[name] = np.sqrt(np.mean(error.squares(estimates), axis=0))
# --8<-- [end:run]

# --8<-- [start:table]
spread = {name: result.parameters.std(axis=0) for name, result in results.items()}
units = {"m/s^2": ("mm/s²", 1e3), "1": ("ppm", 1e6), "rad": ("mgon", 1 / MGON)}
print(f"{'sd of':>9}  {'gravity':>8} {'robot':>8}         robot is better by")
for i, parameter in enumerate(model.parameters):
    unit, factor = units[parameter.unit]
    gravity, robot = (factor * spread[name][i] for name in ("gravity", "robot"))
    print(f"{parameter.name:>9}  {gravity:8.3f} {robot:8.3f}  {unit:5}  {1 - robot / gravity:.0%}")
for i, angle in enumerate(("roll", "pitch")):
    gravity, robot = (tilt[name][i] / MGON for name in ("gravity", "robot"))
    print(f"{angle:>9}  {gravity:8.2f} {robot:8.2f}  mgon   {1 - robot / gravity:.0%}")
for name, result in results.items():
    scales = np.corrcoef(result.parameters.T)[3, 4]
    print(f"{name}: redundancy {result.redundancy}, correlation of s_x and s_y {scales:.2f}")
# --8<-- [end:table]

# --8<-- [start:figure]
single = {n: (result.parameters[0], result.sigma_posteriori[0]) for n, result in results.items()}
figure, panels = plt.subplots(2, 3, figsize=(9, 5), layout="constrained")
kinds = [("bias", slice(0, 3)), ("scale", slice(3, 6)), ("non-orthogonality", slice(6, 9))]
for column, (kind, own) in zip(panels.T, kinds, strict=True):
    unit, factor = units[model.parameters[own.start].unit]
    labels = [parameter.symbol for parameter in model.parameters[own]]
    for offset, (name, (estimate, sigma)) in zip((-0.2, 0.2), single.items(), strict=True):
        places = np.arange(3) + offset
        column[0].bar(places, factor * (estimate - truth)[own], 0.4, label=name)
        column[1].bar(places, factor * sigma[own], 0.4, label=name)
    for panel in column:
        panel.set_xticks(range(3), labels)
        panel.axhline(0, color="black", linewidth=0.8)
    column[0].set_title(f"{kind} / {unit}")
panels[0, 0].set_ylabel("error of one calibration")
panels[1, 0].set_ylabel("its standard deviation")
panels[1, 0].legend(loc="lower center")
figure.savefig("paper.png", dpi=120)
# --8<-- [end:figure]
