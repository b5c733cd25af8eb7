"""Start values: estimates from the records without simulation, and the units of the search."""
