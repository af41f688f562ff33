# A new scheme, in Python and as a file.

# --8<-- [start:compare]
python compare.py
# --8<-- [end:compare]

# --8<-- [start:file]
accelstudy schemes mine.yaml fibonacci-10
accelstudy simulate-campaign --scheme mine.yaml --approach gravity --out session
accelstudy calibrate session --out calibrated
# --8<-- [end:file]
