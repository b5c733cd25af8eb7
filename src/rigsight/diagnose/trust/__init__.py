"""Trust in parameters: estimated again by record, amplitude, constant and window."""
