"""Reading a single measured file from Python, with the signals of a given rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from rigsight.records import ColumnMapping, Hold, Kind, Record, Role
from rigsight.records import read_record as read_file
from rigsight.rigs import Rig, rotational
from rigsight.workflow.campaign.campaign_file import Where, checked_numbers
from rigsight.workflow.campaign.in_memory import rig_of
from rigsight.workflow.campaign.read_campaign import options_of


def read_record(
    path: str | Path,
    rig: str | Rig,
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
