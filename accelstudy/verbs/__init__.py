"""One function a verb: what programs call, and what commands are made of.

They import what works when they are called, so that a help text and an editor need no waiting.
"""
