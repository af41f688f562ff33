"""What the jobs of all workflows share: their log, their origin, and what earlier runs left."""
