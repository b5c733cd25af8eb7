"""C source compiled to libraries with the available compiler, and cached."""

from rigsight.libraries.library_cache import cache_folder as cache_folder
from rigsight.libraries.library_cache import is_kept as is_kept
from rigsight.libraries.library_cache import library_file as library_file
