"""Mutated logs for the reader, and runs killed while they write: ``python -m tests.fuzz``."""
