"""What each term of the Earth, and each algorithm, is worth on a log."""
