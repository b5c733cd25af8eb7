"""Versions of the packages on which the values of a result depend."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_VERSIONS_OF = ("rigsight", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions of these packages, by name."""
    found = {"python": platform.python_version()}
    for package in _VERSIONS_OF:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
