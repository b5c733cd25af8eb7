"""A blind bench on disk: trials drawn, diagnosed apart from their keys, kept and scored."""
