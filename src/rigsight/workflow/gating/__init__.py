"""What a gate knows of a model and asks of records."""
