# A new effect with a setting.

# --8<-- [start:find]
python find_ripple.py
# --8<-- [end:find]
