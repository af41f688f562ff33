# A new effect with a setting.

# --8<-- [start:find]
python find_ripple.py
# --8<-- [end:find]

# --8<-- [start:commands]
accelstudy simulate-campaign --plugin ripple.py --out session --scheme fibonacci-40 --effect "ripple(period=5): 0.006, -0.004, 0.005"
accelstudy calibrate --plugin ripple.py session --model "bias-scale-nonorthogonality+ripple(period=5)" --approach robot --out calibrated
# --8<-- [end:commands]
