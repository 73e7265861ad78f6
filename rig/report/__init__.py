"""Reports: one self-contained HTML file that opens from disk, without network, fonts or libraries from elsewhere."""
