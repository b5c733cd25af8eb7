"""The work of `rigsight gate`: a model and new records -> `gate.json` and JUnit XML; does the model still hold?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from rigsight.compare import NumberCheck, Suspect, UsualGap, free_run, is_at_rest, suspects
from rigsight.compare.on_one_record import FreeRun
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import Model, structure_of_fit
from rigsight.units import behind
from rigsight.workflow.campaign.model_file import named_model
from rigsight.workflow.gating import (
    FALSE_ALARMS,
    Check,
    Limits,
    Reader,
    Reference,
    beside,
    gap_check,
    known_gaps,
    number_checks,
    of_diagnosis,
    of_records,
)
from rigsight.workflow.run.kernels import prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_target, check_writable, json_text, write_together

SCHEMA_VERSION = 1
GATE_FILE = "gate.json"
SIMULATING = "Simulating"


@dataclass(frozen=True)
class Gate:
    """Whether a model still holds for new records."""

    rig: str
    checks: tuple[Check, ...]  # of each sensor of each record
    numbers: tuple[NumberCheck, ...]  # of each number of each record, where their scatter is known
    # The record with the largest excess, of which the rest is known; empty where the gate is open.
    examined: str
    suspects: tuple[Suspect, ...]  # changed numbers, the one that explains most of its gap first
    failures: Mapping[str, str]  # why a record could not be simulated, by its name
    notes: tuple[str, ...]

    @property
    def closed(self) -> bool:
        """True if a gap or a changed number exceeds its limit, or a record cannot be simulated."""
        closed = [own.closed for own in self.checks] + [own.closed for own in self.numbers]
        return bool(self.failures) or any(closed)

    @property
    def first_suspect(self) -> Suspect | None:
        """What to look at first; None where nothing is suspected."""
        return next(iter(self.suspects), None)

    @property
    def place(self) -> str:
        """Joint, drive or sensor of the first suspect, else the sensor with the largest excess; empty where the gate is open."""
        if not self.closed:
            return ""
        first = self.first_suspect
        worst = max(self.checks, key=lambda check: check.excess, default=None)
        return (first.where if first is not None else "") or ("" if worst is None else worst.output)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``gate.json``."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "rig": self.rig,
            "closed": self.closed,
            "place": self.place or None,
            "first_suspect": self.first_suspect,
            "false_alarms": FALSE_ALARMS,
            "checks": [
                {
                    "record": check.record,
                    "sensor": check.output,
                    "unit": check.unit,
                    "gap": check.gap,
                    "gap_in_floors": check.gap / check.floor,
                    "noise_floor": check.floor,
                    "usual": check.usual,
                    "limit": check.limit,
                    "p_value": check.p_value,
                    "moves_farther": check.beyond,
                    "closed": check.closed,
                }
                for check in self.checks
            ],
            "numbers": [
                {
                    "record": check.record,
                    "name": check.number.name,
                    "unit": check.number.unit,
                    "value": check.number.value,
                    "change": check.number.change,
                    "usual": check.usual,
                    "allowed": check.allowed,
                    "p_value": check.p_value,
                    "closed": check.closed,
                }
                for check in self.numbers
            ],
            "not_simulated": dict(self.failures),
            "examined": self.examined or None,
            "suspects": self.suspects,
            "notes": self.notes,
        }
        return json_data(content)

    def to_junit(self) -> str:
        """Return the checks as JUnit XML."""
        cases = [(f"{own.record}: {own.output}", check_text(own), own.closed) for own in self.checks]
        for name in dict.fromkeys(own.record for own in self.numbers):
            changed = [own for own in self.numbers if own.record == name and own.closed]
            text = "; ".join(map(number_text, changed)) or "no number has changed"
            cases.append((f"{name}: numbers", text, bool(changed)))
        cases += [(name, reason, True) for name, reason in self.failures.items()]
        return junit_xml(f"rigsight gate {self.rig}", cases, suspect_text(self))


def run_gate(
    model: str | Path,
    records: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    campaign: Path | None = None,
    floors: float | None = None,
    limits: Sequence[str] = (),
    junit: Path | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Sequence[Rig] = (),
    listener: Listener = silent,
) -> Gate:
    """Hold the gaps of a model on new records against their limits."""
    if out is not None:
        check_writable(Path(out), GATE_FILE)
    if junit is not None:
        own = [Path(model), *map(Path, records), *([] if out is None else [Path(out) / GATE_FILE])]
        if junit.resolve() in {file.resolve() for file in own}:
            raise InputError(
                f"--junit {junit} is a file that this run reads or writes. Give the XML another name."
            )
        check_target(junit)
    read = named_model(model, own_effects, own_rigs)
    asked = Limits.read(floors, limits, read.structure.rig)
    reader = Reader(read, campaign, own_effects, own_rigs)
    new = reader.read(records)
    known = () if campaign is None else reader.of_campaign(campaign)
    prepare_kernels([structure_of_fit(read.structure, [record]) for record in (*new, *known)], 1, listener)
    gate = gate_of(read, new, _reference(read, Path(model), known, new), asked, listener)
    if out is not None:
        write_together(Path(out), {GATE_FILE: json_text(gate.to_json())})
    if junit is not None:
        write_together(junit.parent, {junit.name: gate.to_junit()})
    return gate


def gate_of(
    model: Model,
    records: Sequence[Record],
    reference: Reference,
    limits: Limits,
    listener: Listener = silent,
) -> Gate:
    """Hold the gaps of a model on records against their limits."""
    rig = model.structure.rig
    outputs = [signal.name for record in records for signal in rig.outputs if signal.name in record]
    # Each sensor counts as often as a record holds it.
    tested = [o for o in outputs if limits.asked(o, 1.0) is None and UsualGap.of(reference.known, o)]
    n_tested = max(1, len(tested))
    known = {gap.output for gap in reference.known}
    if not any(output in known or limits.asked(output, 1.0) is not None for output in outputs):
        raise InputError(
            "Nothing is known of the gaps of this model: there is no diagnosis beside it. Name a campaign for which it "
            "is known to hold with --campaign, or set a limit with --floors or --limit."
        )
    stage = Stage(SIMULATING, len(records) + 1, listener)
    runs: dict[str, FreeRun] = {}
    checks, numbers = list[Check](), list[NumberCheck]()
    failures, notes = dict[str, str](), list[str]()
    for record in records:
        notes += [own if own.startswith(record.name) else f"{record.name}: {own}" for own in record.notes]
        try:
            run = free_run(model, record, reference.windows(record), reference.floors)
        except SimulationError as error:
            failures[record.name] = str(error)
        else:
            runs[record.name] = run
            found = [gap_check(gap, rig, limits, reference, n_tested) for gap in known_gaps(record, run)]
            checks += [check for check in found if check is not None]
            numbers += number_checks(model, record, limits, reference, len(records))
            notes += _notes(record, run, found)
            if is_at_rest(reference.windows(record), reference.floors):
                notes.append(
                    f"{record.name}: nothing moves more than its noise, so numbers are not compared; this record cannot show "
                    "that one has changed."
                )
        stage.finished(record.name)
    gate = Gate(rig.name, tuple(checks), tuple(numbers), "", (), failures, tuple(notes))
    excess = [(own.excess, own.record) for own in checks] + [(own.excess, own.record) for own in numbers]
    largest, worst = max(excess, default=(0.0, ""))
    if not largest > 1.0:
        return gate
    record = next(record for record in records if record.name == worst)
    changed = suspects(model, reference.windows(record), runs[record.name], reference.floors)
    stage.finished("suspects")
    return replace(gate, examined=record.name, suspects=tuple(changed))


def check_text(check: Check) -> str:
    """Return a check in words."""
    usual = "" if check.usual is None else f", usually {check.usual:.3g} {check.unit}"
    return (
        f"gap {check.gap:.3g} {check.unit} ({check.gap / check.floor:.3g} x noise floor), "
        f"limit {check.limit:.3g} {check.unit}{usual}"
    )


def number_text(check: NumberCheck) -> str:
    """Return a changed number in words."""
    own, unit = check.number, behind(check.number.unit)
    return (
        f"{own.name} = {own.value:.4g}{unit}: this record asks for {own.change:+.2g}, usually {check.usual:+.2g} +/- "
        f"{check.allowed:.2g}"
    )


def suspect_text(gate: Gate) -> str:
    """Return in words what to look at first; empty where the gate is open."""
    first = gate.first_suspect
    if first is None:
        return f"Place: {gate.place}." if gate.place else ""
    at = f" in {first.where}" if first.where else ""
    unit = behind(first.unit)
    return (
        f"First suspect: {first.what}{at}, {first.before:.4g} -> {first.after:.4g}{unit}, explains {first.share:.0%} of the "
        f"squared gap in '{gate.examined}'. Other changes at this place, such as friction, may look alike; rigsight diagnose "
        "weighs them."
    )


def _reference(model: Model, path: Path, known: Sequence[Record], new: Sequence[Record]) -> Reference:
    """Return what is known of the gaps of a model, with floors of all sensors that the new records hold."""
    diagnosis = beside(path)
    if known:
        found = of_records(model, known, are_known=True)
    elif diagnosis is not None:
        found = of_diagnosis(diagnosis, model)
    else:
        return of_records(model, new, are_known=False)
    rig = model.structure.rig
    if all(signal.name in found.floors for signal in rig.outputs):
        return found
    own = {floor.output: floor.std for floor in noise_floors(rig, new, found.window is not None)}
    return replace(found, floors={**own, **found.floors})


def _notes(record: Record, run: FreeRun, found: Sequence[Check | None]) -> list[str]:
    notes = []
    if not run.estimated:
        notes.append(f"{record.name}: the model is too stiff for a fit; its initial state was approximated.")
    if any(check is None for check in found):
        notes.append(
            f"{record.name}: a sensor that no known record holds is not checked; set --limit for it."
        )
    farther = [check.output for check in found if check is not None and check.beyond]
    if farther:
        notes.append(
            f"{record.name}: {', '.join(farther)} moves farther than in any record for which the model is known to hold, so the "
            "usual gap is extrapolated."
        )
    return notes


def junit_xml(suite: str, cases: Sequence[tuple[str, str, bool]], text: str) -> str:
    """Return cases, each with its name, what was found and whether it failed, as XML; the text says what was found as a whole."""
    failures = str(sum(failed for _, _, failed in cases))
    counts = {"name": suite, "tests": str(len(cases)), "failures": failures, "errors": "0", "skipped": "0"}
    root = ET.Element("testsuites", {key: counts[key] for key in ("tests", "failures")})
    element = ET.SubElement(root, "testsuite", counts)
    for name, found, failed in cases:
        own = ET.SubElement(element, "testcase", classname=suite, name=_printed(name), time="0")
        if failed:
            ET.SubElement(own, "failure", message=_printed(found), type="gap")
        else:
            ET.SubElement(own, "system-out").text = _printed(found)
    ET.SubElement(element, "system-out").text = _printed(text)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _printed(text: str) -> str:
    """Return a text with a sign for each character that XML does not allow."""
    return "".join(sign if sign.isprintable() else "\ufffd" for sign in text)
