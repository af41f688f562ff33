"""The score: answers judged by the truths, what is wanted of them, tables, figures and pages."""
