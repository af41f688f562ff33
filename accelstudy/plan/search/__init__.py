"""The search: what is asked, all calibrations by linear theory, and the best ones simulated."""
