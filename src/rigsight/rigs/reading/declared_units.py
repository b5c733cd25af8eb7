"""Checks of the units of all expressions of a rig file."""

from __future__ import annotations

from rigsight.rigs.reading.declaration import Declaration, Path, quoted
from rigsight.rigs.reading.dimensions import Dimension, UnitError, dimension, dimension_of, measured_in
from rigsight.rigs.reading.expressions import ExpressionError, force_name, rate_name

_TIME = "s"
_ENERGY = "J"


def check_units_add_up(declaration: Declaration, order: list[Path]) -> None:
    """Reject unknown or inconsistent units."""
    _Units(declaration).check(order)


class _Units:
    def __init__(self, declaration: Declaration) -> None:
        self._declaration = declaration
        self._table = declaration.table
        self._second, self._energy = dimension(_TIME), dimension(_ENERGY)
        self._dimensions = self._declared()

    def check(self, order: list[Path]) -> None:
        for name in self._table.joints:
            motion = self._of(("joints", name, "motion"))
            self._dimensions[force_name(name)] = None if motion is None else self._energy / motion
        for path in order:
            self._check_signal(path)
        for part in ("kinetic", "potential"):
            self._is(("energy", part), self._energy, "as energies are")
        for name in self._table.joints:
            self._check_joint(name)
        for name in self._table.drives:
            along = self._of(("drives", name, "along"))
            wanted = None if along is None else self._energy / along
            self._is(
                ("drives", name, "force"),
                wanted,
                "because force times the expression that it acts along is in J",
            )
        for name, state in self._table.states.items():
            measured = dimension(state.unit)
            self._is(("states", name, "rate"), measured / self._second, "from the unit of the state")
            if state.start is not None:
                self._is(("states", name, "start"), measured, "as the state is")
        for name, alternative in self._table.alternatives.items():
            gives = alternative.gives
            self._is(("alternatives", name, "value"), self._dimensions[gives], f"as {gives} is")
        for name in self._table.initial:
            self._is(("initial", name), self._dimensions[name], "as what starts is")

    def _declared(self) -> dict[str, Dimension]:
        found: dict[str, Dimension] = {}
        for key in ("inputs", "constants", "parameters", "alternatives", "coordinates", "states", "sensors"):
            for name, own in getattr(self._table, key).items():
                try:
                    measured = dimension(own.unit)
                except UnitError as error:
                    self._declaration.refuse((key, name, "unit"), str(error))
                # A sensor may be called as the coordinate that it shows; what a control law reads of it is a reading.
                found.setdefault(name, measured)
                if key == "coordinates":
                    found[rate_name(name)] = measured / self._second
        return found

    def _of(self, path: Path) -> Dimension:
        expression = self._declaration.expressions[path]
        read = {
            name: dimension(self._table.sensors[name].unit)
            for name in expression.reads
            if self._declaration.reads_sensor(path, name)
        }
        try:
            return dimension_of(expression, {**self._dimensions, **read})
        except ExpressionError as error:
            self._declaration.refuse_expression(path, error)

    def _is(self, path: Path, wanted: Dimension, why: str) -> None:
        got = self._of(path)
        if got is not None and wanted is not None and got != wanted:
            text = quoted(self._declaration.expressions[path].text)
            self._declaration.refuse(
                path, f"'{text}' is {measured_in(got)} but should be {measured_in(wanted)}, {why}"
            )

    def _check_signal(self, path: Path) -> None:
        key, name = path[0], str(path[1])
        if key == "sensors":
            self._is(path, dimension(self._table.sensors[name].unit), "as its unit says")
        else:
            self._dimensions[name] = self._of(path)

    def _check_joint(self, name: str) -> None:
        motion, force = self._of(("joints", name, "motion")), self._dimensions[force_name(name)]
        if motion is None or force is None:
            return
        self._is(("joints", name, "stiffness"), force / motion, "from the unit of the motion")
        self._is(("joints", name, "damping"), force * self._second / motion, "from the unit of the motion")
        self._is(("joints", name, "rest"), motion, "as the motion is")
        self._is(("joints", name, "force"), force, "from the unit of the motion")
        if self._table.joints[name].inertia is not None:
            self._is(
                ("joints", name, "inertia"), force * self._second**2 / motion, "from the unit of the motion"
            )
