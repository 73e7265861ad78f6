"""Simulated CANopen devices as pure cores: frames in, frames out, no thread, no clock, no I/O.

They are written from the standards alone and share no code with the drivers, so that a misreading in one
shows against the other. `bench.py` puts the four devices of the shipped bench together.
"""
