"""C texts as libraries: compiled by what this machine has, and kept."""

from rigsight.libraries.library_cache import cache_folder, is_kept, library_file

__all__ = ["cache_folder", "is_kept", "library_file"]
