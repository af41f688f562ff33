"""A sensor with a ripple: calibrated without it and with it, and diagnosed."""

# --8<-- [start:known]
import ripple  # noqa: F401, to import it is to make it known

import accelstudy as acs
from accelstudy.effects import get_effect

effect = get_effect("ripple(period=5)")
low, high = effect.typical
print(f"{effect.spec}: {effect.equation}, usually {low:g} to {high:g} m/s²")
# --8<-- [end:known]

# --8<-- [start:calibrate]
hidden = "ripple(period=5): 0.006, -0.004, 0.005"
campaign = acs.simulate_campaign(scheme="fibonacci-40", effects=hidden)
nine = "bias-scale-nonorthogonality"
for name in (nine, f"{nine}+ripple(period=5)"):
    calibration = acs.calibrate(campaign, model=name)
    variance = calibration.content["variance_of_unit_weight"]
    print(f"{name}: variance of unit weight {variance:.2f}")
for parameter in effect.parameters:
    value, sigma = 1e3 * calibration.parameters.loc[parameter.name, ["value", "sigma"]]
    print(f"{parameter.name} = {value:.2f} ± {sigma:.2f} mm/s²")
# --8<-- [end:calibrate]

# --8<-- [start:diagnose]
diagnosis = acs.diagnose(campaign)
print(diagnosis.verdict)
print("its setting:", diagnosis.result.found[0].spec)
# --8<-- [end:diagnose]
