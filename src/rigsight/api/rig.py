"""Declaring a rig from Python, with the keys of a rig file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from rigsight.rigs import Rig as DeclaredRig
from rigsight.rigs import read_rig_file, rig_of_tables

Table = Mapping[str, Any]
Tables = Mapping[str, Table]


class Rig(DeclaredRig):
    """A rig of your own: its inputs, coordinates and energies, the places at which effects can act, and its sensors.

    Takes the tables of a rig file under their names, and checks them in the same way; ``rigsight rigs NAME`` prints the file of
    a built-in rig. Expressions are texts of declared names; ``d(phi)`` is the rate of the coordinate ``phi``.

    Parameters
    ----------
    name
        Name in results: letters, digits and underscores.
    summary
        One plain sentence.
    inputs
        Recorded signals that drive it: ``{"u": {"unit": "A", "about": "motor current"}}``.
    constants
        Known numbers: ``{"k_t": {"unit": "N m/A", "default": 0.05}}``.
    parameters
        Numbers to identify; ``lower``, ``upper``, ``default`` and ``log`` are optional.
    alternatives
        Known numbers from which a parameter follows: ``unit``, ``gives`` and ``value``.
    coordinates
        Degrees of freedom: ``{"phi": {"unit": "rad"}}``; ``prescribed_by`` names an input whose motion is imposed.
    energy
        ``{"kinetic": "J*d(phi)^2/2", "potential": "..."}``; the equations of motion follow by Lagrange.
    joints
        Where effects of the dynamics act: ``motion``, ``stiffness``, ``damping``, ``rest``, ``force``.
    drives
        Where effects of the actuator act: ``signal``, an input or a control law, ``force`` and ``along``.
    sensors
        Where effects of the sensor act, and what is recorded: ``reads`` and ``unit``.
    states
        First-order states: ``rate``, ``unit`` and ``start``.
    signals
        Named intermediate values.
    initial
        Start values of coordinates, rates and states; by default those of static equilibrium.

    Raises
    ------
    InputError
        Naming the table and key of the error, and what to write instead.

    Examples
    --------
    >>> import rigsight as rs
    >>> fan = rs.Rig(
    ...     name="fan",
    ...     inputs={"u": {"unit": "V"}},
    ...     parameters={
    ...         "J": {"unit": "kg m^2", "lower": 1e-9, "log": True},
    ...         "k_u": {"unit": "N m/V"},
    ...         "d": {"unit": "N m s/rad", "lower": 0.0},
    ...     },
    ...     coordinates={"phi": {"unit": "rad"}},
    ...     energy={"kinetic": "J*d(phi)^2/2"},
    ...     joints={"bearing": {"motion": "phi", "damping": "d"}},
    ...     drives={"motor": {"signal": "u", "force": "k_u*motor", "along": "phi"}},
    ...     sensors={"speed": {"reads": "d(phi)", "unit": "rad/s"}},
    ... )
    >>> model = rs.make_model(fan, {"J": 1e-3, "k_u": 0.02, "d": 1e-3})
    >>> switched_on = rs.Record("on", dt=0.01, signals={"u": [1.0] * 2000}, units={"u": "V"})
    >>> print(f"{rs.simulate_model(model, switched_on)['speed'][-1]:.1f} rad/s")
    20.0 rad/s
    """

    def __init__(
        self,
        name: str,
        *,
        coordinates: Tables,
        sensors: Tables,
        summary: str = "",
        inputs: Tables | None = None,
        constants: Tables | None = None,
        parameters: Tables | None = None,
        alternatives: Tables | None = None,
        energy: Table | None = None,
        joints: Tables | None = None,
        drives: Tables | None = None,
        states: Tables | None = None,
        signals: Table | None = None,
        initial: Table | None = None,
    ) -> None:
        tables = {
            "name": name, "summary": summary, "inputs": inputs, "constants": constants, "parameters": parameters,
            "alternatives": alternatives, "coordinates": coordinates, "energy": energy, "joints": joints, "drives": drives,
            "sensors": sensors, "states": states, "signals": signals, "initial": initial,
        }  # fmt: skip
        given = {key: _plain(table) for key, table in tables.items() if table is not None}
        self._take(rig_of_tables(given, f"Rig '{name}'"))

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """Return the rig that a file declares.

        Parameters
        ----------
        path
            A rig file (TOML).

        Raises
        ------
        InputError
            Naming the file, line and column of the error, and what to write instead.
        """
        rig = cls.__new__(cls)
        rig._take(read_rig_file(Path(path)))
        return rig

    def _take(self, rig: DeclaredRig) -> None:
        # The fields of a frozen dataclass.
        vars(self).update(vars(rig))


def _plain(table: Any) -> Any:
    """Return tables of any kind as the dictionaries that a file would give."""
    return {key: _plain(value) for key, value in table.items()} if isinstance(table, Mapping) else table
