# A sweep of one's own.

# --8<-- [start:init]
accelstudy init my-study
cp quadratic.yaml read.py my-study
cd my-study
# --8<-- [end:init]

# --8<-- [start:cells]
accelstudy cells config/config.yaml quadratic.yaml
# --8<-- [end:cells]

# --8<-- [start:run]
snakemake --cores 2 --configfile quadratic.yaml
# --8<-- [end:run]

# --8<-- [start:read]
python read.py
# --8<-- [end:read]
