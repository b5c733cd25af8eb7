"""Files that commands read and write: whole and together, or not at all."""
