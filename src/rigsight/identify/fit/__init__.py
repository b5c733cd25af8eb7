"""Output-error fits: parameters with which a simulation agrees with its records, and their uncertainty."""
