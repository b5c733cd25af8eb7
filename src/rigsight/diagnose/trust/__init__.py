"""Can the numbers of the verdict's model be trusted? Estimated again by record, amplitude, constant and window, and compared."""
