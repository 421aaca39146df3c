"""Independent truth: motion and gravity that share no code with the packages under test."""
