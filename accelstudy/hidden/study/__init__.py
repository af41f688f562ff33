"""The campaigns of the study, and the jobs that have them diagnosed."""
