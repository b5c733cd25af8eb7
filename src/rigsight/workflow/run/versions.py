"""Which versions of packages do the figures of a result depend on?"""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_VERSIONS_OF = ("rigsight", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions on which figures depend, by package."""
    found = {"python": platform.python_version()}
    for package in _VERSIONS_OF:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
