# Commands whose output depends on the unit of angles; run with ACCELSTUDY_ANGLE_UNIT=deg.
accelstudy import log.csv --out my-campaign --rate 100 --columns fx=0,fy=1,fz=2
accelstudy calibrate my-campaign --out calibrated
accelstudy apply calibrated/calibration.json log.csv --out leveled.csv
accelstudy advise my-campaign --tilt-accuracy 0.01deg --tilt-range 30deg
accelstudy calibrate of-spring --approach robot --out robot
accelstudy diagnose of-spring --out diagnosed
accelstudy compare spring/calibration.json autumn/calibration.json --out both
accelstudy history spring/calibration.json autumn/calibration.json winter/calibration.json --date 2025-04-01 --date 2025-10-01 --date 2026-01-15 --out years
accelstudy schemes --approach robot fibonacci-24 mclaren-24
accelstudy scheme fibonacci-24
accelstudy catalogue models
accelstudy effects --campaign of-spring
accelstudy check-sigmas my-campaign --replicates 100
accelstudy design --positions 9 --starts 1 --tilt-range 30deg --out scheme.yaml
accelstudy export calibrated/calibration.json --form c
