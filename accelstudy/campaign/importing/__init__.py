"""Import: a raw log, or a table of means, becomes a campaign."""
