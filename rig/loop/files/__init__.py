"""model.json: its content, reading and writing, and the check against the catalogue."""
