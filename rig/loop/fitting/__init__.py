"""The fit: normal equations, starts, joint refits, intervals."""
