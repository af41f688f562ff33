"""What the jobs of all workflows share: logs, provenance, and checks of earlier results."""
