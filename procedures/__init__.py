"""What to do: typed intents and one file per procedure."""
