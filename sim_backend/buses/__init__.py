"""Buses between the application and the simulated devices."""
