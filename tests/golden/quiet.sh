# What scripts rely on: --quiet leaves the result and warnings, and a verdict of each kind.
accelstudy import log.csv --quiet --no-figure --out my-campaign --rate 100 --columns fx=0,fy=1,fz=2
accelstudy calibrate my-campaign --quiet --out calibrated
accelstudy apply calibrated/calibration.json log.csv --quiet --out leveled.csv
accelstudy advise my-campaign --quiet --tilt-accuracy 10mgon
accelstudy check-sigmas my-campaign --quiet --replicates 50
accelstudy data-sheet my-campaign --quiet --out sheet.yaml
accelstudy simulate-campaign --quiet --out rejected --effect quadratic_scale --size 5
accelstudy simulate-campaign --quiet --out unknown --no-sigma-known
accelstudy simulate-campaign --quiet --out implausible --effect "bias: 20, 0, 0"
accelstudy calibrate rejected --quiet --approach robot --out rejected-calibrated
accelstudy calibrate unknown --quiet --approach robot --out unknown-calibrated
accelstudy calibrate implausible --quiet --approach robot --out implausible-calibrated
accelstudy diagnose rejected --quiet --out diagnosed
accelstudy compare spring/calibration.json winter/calibration.json --quiet --out both
accelstudy history spring/calibration.json autumn/calibration.json winter/calibration.json --quiet --date 2025-04-01 --date 2025-10-01 --date 2026-01-15 --out years
accelstudy lot of-spring of-autumn of-winter --quiet --out lot
accelstudy design --quiet --positions 6 --starts 1 --model bias --attitudes cube --out scheme.yaml
accelstudy schemes --quiet faces-6
accelstudy effects --quiet
accelstudy catalogue public-data --quiet
accelstudy batch of-spring of-autumn --quiet --out batch
accelstudy catalogue models --quiet | tail -n 3
accelstudy scheme --quiet faces-6
accelstudy cells --quiet config/config.yaml config/smoke.yaml | tail -n 3
accelstudy config-schema --quiet | tail -n 3
accelstudy init my-study --quiet
accelstudy export calibrated/calibration.json --form json
accelstudy export calibrated/calibration.json --form c
accelstudy export calibrated/calibration.json --quiet --form matrix
accelstudy export calibrated/calibration.json --form matrix
accelstudy calibrate nowhere --out nothing
accelstudy export nowhere.json
accelstudy apply calibrated/calibration.json log.csv --out leveled.csv
