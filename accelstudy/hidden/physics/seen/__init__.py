"""What a calibration can see of an effect, and what could best be said of it."""
