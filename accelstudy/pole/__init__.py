"""What roll and pitch are worth on a pole: the error of its foot, and where it comes from."""
