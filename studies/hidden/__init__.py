"""How well the diagnosis finds what is hidden: campaigns with a known truth, answers, and scores.

`physics` makes campaigns and their truths, `study` has them diagnosed, `score` joins truths and
answers, and `page` shows the score. The diagnosis imports nothing from here, and `physics` nothing
from the diagnosis.
"""
