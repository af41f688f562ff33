"""A sensor with a ripple: calibrated without it and with it, and diagnosed."""

# --8<-- [start:known]
import ripple  # noqa: F401, to import it is to make it known

from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.effects import get_effect
from accelstudy.sensors.models import get_model

effect = get_effect("ripple(period=5)")
low, high = effect.typical
print(f"{effect.spec}: {effect.equation}, usually {low:g} to {high:g} m/s²")
# --8<-- [end:known]

# --8<-- [start:calibrate]
hidden = "ripple(period=5): 0.006, -0.004, 0.005"
campaign, _ = simulate_campaign(CampaignSettings(scheme="fibonacci-40", effects=(hidden,)))
nine = "bias-scale-nonorthogonality"
for name in (nine, f"{nine}+ripple(period=5)"):
    model = get_model(name)
    result = fit_campaign(campaign, model, get_approach("robot")).adjustment
    print(f"{name}: variance of unit weight {result.variance_posteriori[0]:.2f}")
for i, parameter in enumerate(model.parameters):
    if parameter in effect.parameters:
        value, sigma = 1e3 * result.parameters[0, i], 1e3 * result.sigma_priori[0, i]
        print(f"{parameter.name} = {value:.2f} ± {sigma:.2f} mm/s²")
# --8<-- [end:calibrate]

# --8<-- [start:diagnose]
diagnosis = diagnose(campaign, get_model(nine))
print(*verdict_lines(diagnosis), sep="\n")
print("its setting:", diagnosis.found[0].spec)
# --8<-- [end:diagnose]
