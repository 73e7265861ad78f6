"""Benchmarks, run on demand (`make bench`); they print ratios of one run and assert nothing."""
