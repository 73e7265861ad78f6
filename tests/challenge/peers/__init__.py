"""Selectors of other packages on the campaigns of the blind test: `python -m tests.challenge.peers` (extra `peers`)."""
