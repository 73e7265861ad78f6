"""Tests of the CANopen drivers: wire tests, codecs, and behaviour against the simulated devices."""
