# %% [markdown]
# # Planning a calibration
#
# How many positions does it take, and is a robot needed? The answer follows from the accuracy of
# roll and pitch that you want, and from the sensor.
#
# ## The cheapest calibration
#
# Of the sensor only the noise in the mean of a position is known here. `max_positions` keeps this
# notebook quick; without it, up to 200 positions are compared.

# %%
import matplotlib.pyplot as plt
import numpy as np

import accelstudy as acs

asked = {"tilt_accuracy": "20 mgon", "tilt_range": "50 gon", "sigma": "2 mm/s^2"}
plan = acs.plan(**asked, max_positions=40)
plan

# %% [markdown]
# `verdict` is what to do, in one line. Of the cheapest calibrations of each kind, the first are
# simulated: their columns end in `simulated_mgon`.

# %%
print(plan.verdict)
plan.to_frame()[["equipment", "n_positions", "minutes", "roll_rms_simulated_mgon", "limited_by"]]

# %% [markdown]
# All that was compared is in the figure. A point is a model, a scheme, a number of positions and a
# duration; the lines are the best of each kind.

# %%
ax = plan.plot()

# %% [markdown]
# ## More certainty takes more positions
#
# By default, the rms over many calibrations reaches the accuracy. About half of single ones leave
# more in roll or in pitch. `confidence` asks that both angles reach it in so many calibrations.

# %%
surer = acs.plan(**asked, confidence="95%", equipment="gravity", max_positions=40)
print(surer.verdict)

# %% [markdown]
# ## A plan, checked
#
# `save` writes the positions of the recommended calibration into `positions.yaml`, a scheme. What
# it leaves can be simulated once more: the share of the calibrations that stay below the accuracy
# must be about what was asked for.

# %%
surer.save("plan", force=True)
best = surer.to_frame().iloc[0]
check = acs.simulate(
    best["model"],
    "plan/positions.yaml",
    best["equipment"],
    sigma=best["sensor_sigma_mps2"],
    replicates=2000,
)
worse = check.tables["quantiles"].query("quantity == 'tilt' and name == 'both'")
below = np.interp(20, worse["value"], worse["probability"])
_, ax = plt.subplots(figsize=(6, 2.5), layout="constrained")
ax.plot(worse["value"], worse["probability"], color="#4A4A4A")
ax.axvline(20, color="#C2247A")
ax.set(xlabel="larger of the tilt errors in roll and in pitch / mgon", ylabel="share below")
print(f"below 20 mgon: {100 * below:.0f} %")

# %% [markdown]
# [The cheapest calibration](../guides/plan.md) has all options, and `sensor` takes [a data
# sheet](../reference/data-sheets.md) in place of `sigma`.
