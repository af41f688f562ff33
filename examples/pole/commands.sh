# The foot of a tilted pole: what a calibration is worth in millimetres.

# --8<-- [start:calibrate]
accelstudy simulate-campaign --out box --truth box.yaml --scheme mclaren-24 --sigma 0.00006 \
  --effect "bias: 0.12, -0.08, 0.2" --effect "scale: 0.004, -0.003, 0.006"
accelstudy calibrate box --approach gravity --out calibrated
# --8<-- [end:calibrate]

# --8<-- [start:budget]
python pole.py calibrated/calibration.json adxl355
# --8<-- [end:budget]
