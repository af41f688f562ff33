"""Settings of all tests: Hypothesis repeats the same examples, and no test fails on a clock."""

from hypothesis import settings

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("repeatable")
