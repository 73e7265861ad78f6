"""The log: MCAP written live, read back, recovered, exported; CSV and foreign logs in."""
