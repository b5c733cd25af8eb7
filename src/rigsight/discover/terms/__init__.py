"""Terms that a discovered equation may hold: powers, effects, memory; and how they are written."""
