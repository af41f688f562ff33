# Fifty sensors of one type.

# --8<-- [start:make]
python make_lot.py
# --8<-- [end:make]

# --8<-- [start:lot]
accelstudy lot "sensors/*" --out lot
# --8<-- [end:lot]

# --8<-- [start:next]
accelstudy calibrate next --model lot/type.yaml --prior lot/type.yaml --out calibrated
# --8<-- [end:next]

# --8<-- [start:plan]
accelstudy plan --sensor lot/type.yaml --tilt-accuracy 20mgon --tilt-range 30gon --out plan
# --8<-- [end:plan]
