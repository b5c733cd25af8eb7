"""What an identification finds beyond one record, and how it reaches the disk."""
