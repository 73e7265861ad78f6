"""The bench that is not there: harmonic-drive model, plant, simulated nodes and their bus."""
