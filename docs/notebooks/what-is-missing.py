# %% [markdown]
# # What is missing
#
# A calibration is rejected when the positions contradict the sensor model. This notebook hides an
# effect in a campaign, sees the calibration fail, and finds the effect again.
#
# ## A campaign with a secret
#
# The sensor below has the usual errors and one more: its bias follows the temperature. A robot
# holds it in 30 positions, in random order, while the temperature goes up and down between 15 and
# 40 °C.

# %%
import pandas as pd

import accelstudy as acs

campaign = acs.simulate_campaign(
    scheme="fibonacci-30",
    order="random",
    temperature=(15, 40),
    temperature_order="random",
    yaw="random",
    effects="thermal_bias",
)
campaign

# %% [markdown]
# ## The usual model fails
#
# The residuals are far larger than the noise that the campaign states.

# %%
calibration = acs.calibrate(campaign, approach="robot")
print(calibration.state)
ax = calibration.plot()

# %% [markdown]
# ## The diagnosis
#
# `diagnose` weighs the effects of the catalogue, up to three together, against noise, gross
# errors and each other. It takes some seconds.

# %%
diagnosis = acs.diagnose(campaign)
diagnosis

# %%
ax = diagnosis.plot()

# %% [markdown]
# ## The calibration with what was found
#
# The diagnosis brings a calibration with the effect in its model. It has three parameters more,
# one for each axis, in m/s² per kelvin.

# %%
mended = diagnosis.calibration
print(mended.state)
ax = mended.plot()

# %% [markdown]
# Without the effect in the model, the other parameters are off by many of the standard deviations
# that they have with it.

# %%
both = {"usual model": calibration.parameters, "with the effect": mended.parameters}
pd.concat({name: table[["value", "sigma"]] for name, table in both.items()}, axis=1)

# %% [markdown]
# To use this calibration, a log needs a column of temperature. `diagnosis.result` leads to all the
# rest: tests of the noise, limits of the effects that were not found, and [what else a diagnosis
# says](../guides/diagnosis.md).
