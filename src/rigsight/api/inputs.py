"""What a fit is given, from Python: a rig declared with the keys of a rig file, and a record with the signals of a rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from rigsight.records import ColumnMapping, Hold, Kind, Record, Role
from rigsight.records import read_record as read_file
from rigsight.rigs import Rig as DeclaredRig
from rigsight.rigs import read_rig_file, rig_of_tables, rotational
from rigsight.workflow.campaign.campaign_file import Where, checked_numbers
from rigsight.workflow.campaign.in_memory import rig_of
from rigsight.workflow.campaign.read_campaign import options_of

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


def read_record(
    path: str | Path,
    rig: str | DeclaredRig,
    *,
    columns: Mapping[str, ColumnMapping | str | int] | None = None,
    require_outputs: bool = True,
    name: str | None = None,
    role: Role = "estimation",
    kind: Kind = "operation",
    amplitude: float | None = None,
    hold: Hold = "foh",
    dt: float | None = None,
    resample: float | None = None,
    start: float | None = None,
    end: float | None = None,
    constants: Mapping[str, float] | None = None,
) -> Record:
    r"""Read, check and repair one record.

    Parameters
    ----------
    path
        Delimited text, or a measurement file of a format that ``rigsight inspect`` reads.
    rig
        Rig of the signals: ``"running_gear"`` (t, u, psi, y), ``"axis"`` (t, u, x), ``"element"`` (t, x, force), the name
        of another built-in rig, or a rig of your own.
    columns
        Columns of the signals and of time ``t``, by name, by number, or with their conversion to SI units; by default the columns
        with the same names. A record of a closed loop may also contain the ``reference`` of its controller.
    require_outputs
        False to simulate the record: its time and inputs suffice.
    name
        Name of the record in results, by default the file's name without its suffix.
    role
        ``"estimation"`` records may be fitted, ``"validation"`` records are only scored.
    kind
        What drove the rig: ``"sweep"``, ``"step"``, ``"multisine"`` or ``"operation"``.
    amplitude
        Amplitude of the input, in its unit.
    hold
        The input between samples: ``"zoh"``, ``"foh"`` or ``"band_limited"``.
    dt
        Sample time [s] of a file without time; time that it has is not read then, with a note.
    resample
        Sample time [s] onto which signals are resampled, low-pass filtered where it is coarser than theirs; without it, signals
        with clocks of their own come onto the finest of them.
    start, end
        Stretch of the file that is the record, by its time [s]; by default all of it.
    constants
        Constants of the rig with a different value in this record, such as a known payload.

    Returns
    -------
    Signals of shape (n_samples,) in SI units, with notes on what was repaired.

    Raises
    ------
    InputError
        If the record is unusable; the message gives file, line or column, and the remedy.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import rigsight as rs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "push.csv"
    ...     rows = [f"{0.01 * i:.2f},{i % 7},{3 + i % 5}" for i in range(50)]
    ...     _ = file.write_text("time,current,travel\n" + "\n".join(rows))
    ...     columns = {
    ...         "t": rs.ColumnMapping("time"),
    ...         "u": rs.ColumnMapping("current"),
    ...         "x": rs.ColumnMapping("travel", scale=1e-3),
    ...     }
    ...     record = rs.read_record(file, "axis", columns=columns)
    >>> record.name, record.n_samples, round(record.dt, 6), float(record["x"][0])
    ('push', 50, 0.01, 0.003)
    """
    found = rig_of(rig)
    return read_file(
        Path(path),
        found.inputs,
        found.outputs,
        replace(
            options_of(found, rotational(found)),
            columns=columns,
            require_outputs=require_outputs,
            name=name,
            role=role,
            kind=kind,
            amplitude=amplitude,
            hold=hold,
            dt=dt,
            resample=resample,
            start=start,
            end=end,
            constants=checked_numbers(
                Where(Path(path).name), ("constants",), found.name, found.constants, constants or {}
            ),
        ),
    )
