# %% [markdown]
# # A study of your own
#
# A question with "how many" or "how good" in it is a study: calibrations of several set-ups, each
# simulated many times. Here: **what do more positions bring, by hand and with a robot?**
#
# ## The set-ups
#
# Names may be lists. Every combination of them is a cell, with so many simulated calibrations.

# %%
import matplotlib.pyplot as plt
import numpy as np

import accelstudy as acs

numbers = [12, 16, 24, 36, 50]
result = acs.simulate(
    "bias-scale-nonorthogonality",
    [f"fibonacci-{n}" for n in numbers],
    ["gravity", "robot"],
    sigma="2 mm/s^2",
    robot_sigma="3.2 mgon",
    truth={"b_x": 0.05, "s_y": "200 ppm", "alpha_zx": "44 mgon"},
    replicates=1000,
)
result

# %% [markdown]
# The table has the tilt error that a calibration leaves at tilts up to 50 gon, in rad: its rms,
# and what 95 of 100 calibrations stay below, each with the standard error of the simulation.
#
# ## Every calibration
#
# `estimates` has each single calibration: a row for each cell, replicate and parameter.

# %%
calibrations = result.estimates
calibrations[["cell", "replicate", "parameter", "unit", "truth", "estimate", "sigma_posteriori"]]

# %% [markdown]
# Are the estimates free of bias? Their mean should be off the truth by a few of its own standard
# errors at most.

# %%
error = calibrations.groupby(["cell", "parameter"], observed=True)["error"]
in_errors = abs(error.mean()) / error.sem()
print(f"largest of {len(in_errors)}: {in_errors.max():.1f} standard errors")

# %% [markdown]
# ## The answer
#
# The rms tilt error of roll, in mgon, falls with the root of the number of positions. By hand it
# takes about four times as many positions as with this robot.

# %%
leveling = result.tables["leveling"]
positions = leveling["scheme"].str.removeprefix("fibonacci-").astype(int)
rms = leveling.assign(positions=positions).pivot(
    index="positions", columns="approach", values="roll_rms_mgon"
)
rms

# %%
_, ax = plt.subplots(figsize=(6, 3.2), layout="constrained")
for approach, colour in {"gravity": "#4A4A4A", "robot": "#C2247A"}.items():
    ax.loglog(numbers, rms[approach], "o", color=colour, label=approach)
    root = rms[approach].iloc[0] * np.sqrt(numbers[0] / np.array(numbers))
    ax.loglog(numbers, root, ":", color=colour)
ax.legend(title="dotted: 1/√n")
ax.set(xlabel="positions", ylabel="rms tilt error in roll / mgon")
ax.set_xticks(numbers, numbers)
ax.set_yticks([5, 10, 20], [5, 10, 20])
ax.minorticks_off()

# %% [markdown]
# ## The tables of a study
#
# `tables` are the same tables that [a study of the workflow](../guides/configuration.md) writes,
# with the same numbers for the same cells and seed: correlations, quantiles, comparisons with
# linear theory. [Tables of a study](../reference/tables.md) lists their columns.

# %%
columns = ["scheme", "approach", "n_positions", "redundancy", "condition", "n_converged"]
result.tables["cells"][columns]
