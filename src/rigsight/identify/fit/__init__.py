"""Output-error fits: the parameters with which a simulation follows its records, and their uncertainty."""
