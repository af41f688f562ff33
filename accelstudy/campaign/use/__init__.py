"""The use of a calibration: logs leveled by it, and its export to devices."""
