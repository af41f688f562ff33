"""The test of a finding on positions that were used neither to choose nor to fit it."""
