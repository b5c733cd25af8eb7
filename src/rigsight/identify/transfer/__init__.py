"""Transfer functions: PT1 or PT2 from a record, and the physical parameters that follow from it."""
