"""The application: command line, bench, runner, log, loop."""
