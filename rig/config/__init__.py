"""Files that people write: bench.toml and dut.toml."""
