# The paper in two minutes.

# --8<-- [start:paper]
python paper.py
# --8<-- [end:paper]
