# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # A first calibration
#
# Some text.

# %%
import accelstudy as acs

campaign = acs.simulate_campaign(scheme="mclaren-24", approach="gravity")
calibration = acs.calibrate(campaign)
calibration

# %%
ax = calibration.plot()
