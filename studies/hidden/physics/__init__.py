"""Campaigns with hidden effects, by physics of their own.

Nothing here comes from the effects, the approaches or the adjustment of the project, and the
diagnosis imports nothing from here. So the study judges the diagnosis by independent campaigns.
"""
