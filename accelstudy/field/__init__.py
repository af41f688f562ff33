"""What makes roll and pitch uncertain in the field, some time after the calibration."""
