"""The harmonic drive: compliance, friction, effects, and the compiled plant kernel."""
