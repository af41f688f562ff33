"""How well the diagnosis finds what is hidden: campaigns with a known truth, answers, and scores.

`physics` makes campaigns and their truths, `run` has them diagnosed, and `score` joins both. The
diagnosis imports nothing from here, and `physics` nothing of the diagnosis.
"""
