"""The rigs that come with the package: files of the same form as a user's own, read when they are first asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from rigsight.rigs.rig import Rig
from rigsight.rigs.rig_file import rig_of_text


class BuiltInRigs(Mapping[str, Rig]):
    """Name -> rig."""

    def __getitem__(self, name: str) -> Rig:
        if name not in _files():
            raise KeyError(name)
        return _rig(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_files())

    def __len__(self) -> int:
        return len(_files())


RIGS = BuiltInRigs()


def rig_file_text(name: str) -> str:
    """Return the file of a rig that comes with the package.

    Raises
    ------
    KeyError
        If there is no such rig.
    """
    return _files()[name].read_text("utf-8")


@cache
def _files() -> Mapping[str, Traversable]:
    found = (
        file for file in files("rigsight.rigs").joinpath("files").iterdir() if file.name.endswith(".toml")
    )
    return {file.name.removesuffix(".toml"): file for file in sorted(found, key=lambda file: file.name)}


@cache
def _rig(name: str) -> Rig:
    # Their units are checked by the tests: the library that knows units takes a second to load.
    return rig_of_text(rig_file_text(name), f"{name}.toml", check_units=False)


AXIS = RIGS["axis"]
"""One moving mass with a drive."""
ELEMENT = RIGS["element"]
"""A force element on a bench that prescribes the motion."""
RUNNING_GEAR = RIGS["running_gear"]
"""The running gear of the thesis."""
assert RUNNING_GEAR.follower is not None
ROLLING = RUNNING_GEAR.follower
"""Its lateral displacement, which follows the yaw angle."""
