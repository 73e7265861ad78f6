"""How to talk: signals, types, errors, clock, and one driver per device."""
