import accelstudy as acs

log = acs.read_log("imu.csv", rate=100, columns={"fx": "ax", "fy": "ay", "fz": "az"})
campaign = acs.find_holds(log, gravity=9.80795)
calibration = acs.calibrate(campaign)
print(calibration.state, calibration.parameters, sep="\n")
leveled = calibration.apply(log)
calibration.save("calibrated")
calibration.plot()

diagnosis = acs.diagnose(campaign)
print(diagnosis.state, diagnosis.explanations, diagnosis.calibration, sep="\n")
diagnosis.plot()

plan = acs.plan(tilt_accuracy="10 mgon", tilt_range="30 gon", sigma="2 mm/s^2")
print(plan.verdict)
plan.plot()

model, scheme, approach = "bias-scale-nonorthogonality", "mclaren-24", "robot"
result = acs.simulate(model, scheme, approach, sigma=0.002, replicates=1000)
print(result.parameters, result.tilt, sep="\n")
