# From a log to a leveled sensor.

# --8<-- [start:box]
python draw_box.py
# --8<-- [end:box]

# --8<-- [start:logs]
python make_logs.py
head -n 3 calibration.csv
# --8<-- [end:logs]

# --8<-- [start:import]
accelstudy import calibration.csv --time t --columns fx=ax,fy=ay,fz=az --unit g --out box
# --8<-- [end:import]

# --8<-- [start:calibrate]
accelstudy calibrate box --out calibrated
# --8<-- [end:calibrate]

# --8<-- [start:apply]
accelstudy apply calibrated/calibration.json use.csv --out leveled.csv
python compare.py
# --8<-- [end:apply]

# --8<-- [start:export]
accelstudy export calibrated/calibration.json --form c > calibration.h
tail -n 8 calibration.h
# --8<-- [end:export]
