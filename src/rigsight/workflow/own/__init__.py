"""A user's own rigs and effects: declared, checked, found by name."""
