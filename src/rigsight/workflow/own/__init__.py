"""A user's own rigs, effects and simulators: loaded, checked and found by name."""
