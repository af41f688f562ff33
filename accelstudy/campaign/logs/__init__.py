"""Raw logs: text, MATLAB and Parquet files read as rows of numbers, chunk by chunk."""
