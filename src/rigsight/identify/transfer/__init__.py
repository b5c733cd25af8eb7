"""Transfer functions: PT1 or PT2 of a record, and the physical parameters that follow from it."""
