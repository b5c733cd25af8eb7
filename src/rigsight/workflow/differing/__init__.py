"""What differs between diagnoses, and how they are read again."""
