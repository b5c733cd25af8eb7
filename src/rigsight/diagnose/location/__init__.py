"""Location of the gap: its shares by record, frequency band, state and section of the signal path."""
