"""What a finding is worth: on held-out positions, in tilt, in further positions."""
