"""What to measure next: the menu of runs, the rivals refitted, and which run tells them apart in least time."""
