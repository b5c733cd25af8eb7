"""Terms that a discovered equation may contain (powers, effects, memory), and their notation."""
