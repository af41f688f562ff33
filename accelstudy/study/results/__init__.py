"""Results of a study: summary tables, sensitivity, and the page of claims."""
