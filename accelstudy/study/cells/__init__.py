"""Cells of a study: one model, scheme and approach each; and how jobs share them."""
