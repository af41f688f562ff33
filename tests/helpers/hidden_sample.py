"""A sample of the campaigns of the study of hidden effects, with the answers that they got.

A test diagnoses a part of them again: where another answer comes out, the score is older than the
code. `make hidden-docs` writes the sample anew.
"""

import hashlib

import pandas as pd
from places import ROOT

from accelstudy.files.tables import read_table

SAMPLE = ROOT / "tests/hidden/sample.csv"
BY_KIND = ("noise", "one", "gross")
"""Sets of which the sample has a campaign of each kind; of the others it has one of each size."""
ANSWER = {"verdict": "verdict", "confirmed": "confirmed", "explanation": "explanation",
          "posterior": "top_posterior", "sigma0": "sigma0_before"}  # fmt: skip
"""What is said of a campaign, and the column of the judged campaigns that has it."""


def sample(rows: pd.DataFrame) -> pd.DataFrame:
    """A campaign of each size or, in some sets, of each kind, as good as at random."""
    kind = rows["what"].where(rows["set"].isin(BY_KIND), rows["size"])
    keys = rows["cell"] + " " + rows["campaign"].astype(str)
    digest = keys.map(lambda key: hashlib.sha256(key.encode()).hexdigest())
    mixed = rows.assign(kind=kind, digest=digest).sort_values("digest")
    return mixed.drop_duplicates(["set", "kind"]).sort_values("cell", kind="stable")


def answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Which campaigns these are, and what is said of them."""
    said = {name: rows[column] for name, column in ANSWER.items()}
    return pd.DataFrame({"cell": rows["cell"], "campaign": rows["campaign"], **said})


if __name__ == "__main__":
    judged = read_table(ROOT / "results/hidden-effects/campaigns.parquet")
    answers(sample(judged)).to_csv(SAMPLE, index=False, float_format="%.4g", lineterminator="\n")
