"""What positions say of a finding that were used neither to choose nor to fit it."""
