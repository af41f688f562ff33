"""Plans by configuration: the sections, the jobs of the workflow, and sensors compared."""
