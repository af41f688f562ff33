import numpy as np

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.design.estimability import estimability
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session

model, robot = get_model("bias-scale-nonorthogonality"), get_approach("robot")
scheme = get_scheme("mclaren-24")
print(estimability(scheme, model, robot).sigma)  # linear theory, SI

truth = model.vector({"b_x": 0.05, "s_x": 200e-6})
simulated = session(model, truth, scheme.directions)
observed = simulated.draw(Noise(sigma_force=0.002), 1000, np.random.default_rng(1))
result = calibrate(model, robot, observed)  # 1000 calibrations at once
print(result.parameters.std(axis=0), result.sigma_posteriori.mean(axis=0))
