"""What the commands do; imported by the command line only when a command runs."""
