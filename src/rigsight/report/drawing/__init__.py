"""Pictures of a page: curves, loops, rigs, responses."""
