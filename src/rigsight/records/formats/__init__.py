"""Measurement files of every format, read so that a damaged one harms nothing."""
