"""Tabulate what the sweep found: the tilt error that each calibration leaves."""

from accelstudy.files.tables import read_table

table = read_table("results/quadratic/leveling.parquet")
table["positions"] = table["scheme"].str.extract(r"(\d+)").astype(int)
table["worse angle"] = table[["roll_rms_mgon", "pitch_rms_mgon"]].max(axis=1)
known = table["model"].str.endswith("quadratic")
table["quadratic"] = known.map({False: "left out", True: "estimated"})
wide = table.pivot(index="positions", columns=["approach", "quadratic"], values="worse angle")
wide = wide.sort_index(axis=1, ascending=[True, False])
print("rms tilt error of the worse angle in mgon, up to 30 gon")
print(wide.round(1).to_string())
