"""The use of a calibration: leveling of logs, and export to devices."""
