# %% [markdown]
# # A first calibration
#
# A sensor was turned by hand into 24 positions, and rested in each for ten seconds. Its readings
# are a log. This notebook finds the rests in the log, calibrates the sensor with them, and levels
# with the result.
#
# ## The log
#
# You need no sensor to try this. The next cell makes a log of one whose errors are known: a bias
# on each axis, and x reads 0.2 % too much. For a log of your own take `table =
# pd.read_csv("imu.csv")`.

# %%
import numpy as np
import pandas as pd

import accelstudy as acs
from accelstudy.schemes import get_scheme

GRAVITY = 9.80795
rng = np.random.default_rng(1)
at_rest = -GRAVITY * get_scheme("fibonacci-24").directions
rows = []
for before, after in zip(np.roll(at_rest, 1, axis=0), at_rest, strict=True):
    rows += [np.linspace(before, after, 100), np.tile(after, (1000, 1))]  # a turn, and a rest
readings = np.concatenate(rows) * [1.002, 1, 1] + [0.05, 0.01, 0.03]
readings += 0.005 * rng.standard_normal(readings.shape)
table = pd.DataFrame(readings, columns=["ax", "ay", "az"])
table

# %% [markdown]
# There is no column of time, so the log needs its rate, and the columns have names of their own.
# `read_log` takes the name of a file just as well.

# %%
log = acs.read_log(table, rate=100, columns={"fx": "ax", "fy": "ay", "fz": "az"})
log

# %% [markdown]
# ## The rests
#
# What stands still is told from the noise of the log itself. The result is a campaign: the mean of
# each rest, with what is known of it. Give the gravity of the place where you measure.

# %%
campaign = acs.find_holds(log, gravity=GRAVITY)
campaign

# %% [markdown]
# The notes say what was found and assumed. The last line is on the noise of a mean: where it is
# much larger than that of white noise, longer rests would help little.

# %%
print(*campaign.notes, sep="\n")

# %% [markdown]
# ## The calibration
#
# With gravity alone, nine parameters are estimated: biases `b`, scale errors `s`, and the angles
# `alpha` between the axes. `sigma` is the standard deviation of each of them.

# %%
calibration = acs.calibrate(campaign)
calibration

# %% [markdown]
# The figure has the verdict at a glance: residuals of good positions lie within the band, and show
# no pattern.

# %%
ax = calibration.plot()

# %% [markdown]
# Here the true errors are known, so they can be set beside the estimates.

# %%
truth = pd.Series({"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 0.002, "s_y": 0.0, "s_z": 0.0})
found = calibration.parameters.loc[truth.index, ["value", "sigma", "unit"]]
found.assign(truth=truth, error_in_sigmas=(found["value"] - truth) / found["sigma"])

# %% [markdown]
# ## Leveling
#
# `apply` adds the calibrated force, roll and pitch, and their standard deviations to each row of a
# log. The units stand in the names of the columns.

# %%
leveled = calibration.apply(log)
leveled.head()

# %% [markdown]
# `save` writes the same folder as `accelstudy calibrate`, with a report. The commands `apply` and
# `export` take it from there.

# %%
calibration.save("calibrated", force=True)

# %% [markdown]
# If a calibration is rejected, [the sensor has an effect that the model
# lacks](what-is-missing.md).
