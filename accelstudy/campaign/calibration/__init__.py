"""The calibration of a campaign: adjustment, assessment, verdict, documents and pages."""
