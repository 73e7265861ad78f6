"""Second formulas and a generator of bench logs, written from the physics alone; imports nothing of the project."""
