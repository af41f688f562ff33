# A hidden effect, found.

# --8<-- [start:hide]
accelstudy simulate-campaign --out session --truth truth.yaml --scheme fibonacci-30 \
  --order random --temperature 15:40 --temperature-order random --yaw random \
  --effect "thermal_bias: 0.0004, -0.0003, 0.0005"
# --8<-- [end:hide]

# --8<-- [start:calibrate]
accelstudy calibrate session --approach robot --out plain
# --8<-- [end:calibrate]

# --8<-- [start:diagnose]
accelstudy diagnose session --out diagnosed
# --8<-- [end:diagnose]

# --8<-- [start:extend]
accelstudy calibrate session --approach robot --model diagnosed/model.yaml --out extended
# --8<-- [end:extend]
