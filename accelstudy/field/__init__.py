"""What makes roll and pitch uncertain in the field, when the calibration is some time ago."""
