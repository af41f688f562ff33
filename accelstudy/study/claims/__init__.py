"""The claims of Thalmann & Neuner (2018), judged by the Monte Carlo.

The paper shows one simulation, with standard deviations a posteriori. So a number of the paper
counts as reproduced if ours agrees with it within the rounding in which it is given, or if it lies
within the central 95 % of what single simulations of the same set-up show. Nothing is tuned to meet
a number. Where one is not met, the verdict says by how much.

`claims.yaml` lists the claims, `quantities.py` measures what they are about, and `verdicts.py`
applies their rules. To add a claim, add an entry to the list.
"""
