"""Every option of every command reaches the work of the command or is refused, as docs/keys.md says: none is ignored."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from rigsight.cli.application import app
from rigsight.errors import InputError
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import make_model

Run = Callable[..., tuple[int, str, str]]

PAGE = (Path(__file__).parents[2] / "docs/keys.md").read_text(encoding="utf-8")
OPTIONS = {
    name: [p.opts[0] for p in command.params if p.param_type_name == "option"]
    for name, command in typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]
}
EVERYWHERE = ("--json", "--quiet", "--debug")
"""They change what is printed, not what is done."""
WORK = {
    "demo": "rigsight.workflow.demo.run_demo",
    "inspect": "rigsight.workflow.inspect.run_inspect",
    "init": "rigsight.workflow.init.run_init",
    "check": "rigsight.workflow.check.run_check",
    "diagnose": "rigsight.workflow.diagnose.run_diagnose",
    "plan": "rigsight.workflow.plan.run_plan",
    "power": "rigsight.workflow.power.run_power",
    "reproduce": "rigsight.workflow.reproduce.run_reproduce",
    "identify": "rigsight.workflow.identify.run_identify",
    "discover": "rigsight.workflow.discover.run_discover",
    "compare": "rigsight.workflow.compare.run_compare",
    "simulate": "rigsight.workflow.simulate.run_simulate",
    "difference": "rigsight.workflow.difference.run_difference",
    "gate": "rigsight.workflow.gate.run_gate",
    "export": "rigsight.workflow.export.run_export",
    "vary": "rigsight.workflow.vary.run_vary",
    "blind": "rigsight_bench.benches.run_blind",
    "app": "rigsight.app.server.serve",
}
"""The function that a command calls; what it makes of its arguments is asked of it in its own tests."""
ELSEWHERE = {
    "--mjcf": "rigsight.workflow.init.run_init_from_mjcf",
    "--campaigns": "rigsight_bench.benches.run_external",
    "--merge": "rigsight_bench.running.score_files.merge",
    "--rescore": "rigsight_bench.benches.rescore",
}
ARGUMENTS: dict[str, list[str]] = {
    "inspect": ["a.csv"],
    "init": ["."],
    "check": ["."],
    "diagnose": ["."],
    "plan": ["."],
    "power": ["."],
    "reproduce": ["report.html"],
    "identify": ["."],
    "discover": ["."],
    "compare": [".", "given"],
    "simulate": ["model.json", "a.csv"],
    "difference": [".", "."],
    "gate": ["model.json", "a.csv"],
    "export": ["model.json", "--to", "python"],
    "vary": ["model.json", "--parameter", "k"],
}
GIVEN: dict[str, list[str]] = {
    "--out": ["elsewhere"],
    "--seed": ["3"],
    "--jobs": ["3"],
    "--by": ["A. Engineer"],
    "--effect": ["cubic_stiffness"],
    "--effects": ["own.py"],
    "--rigs": ["own.toml"],
    "--simulator": ["own_motion.py:move"],
    "--method": ["h1"],
    "--resolution": ["0.5"],
    "--objective": ["free-run"],
    "--initial-samples": ["50"],
    "--one-by-one": [],
    "--step-seconds": ["2.0"],
    "--column": ["u=2"],
    "--unit": ["t=ms"],
    "--initial-state": ["x=0.1"],
    "--constant": ["gain=2.0"],
    "--to": ["c"],
    "--hold": ["zoh"],
    "--step": ["0.01"],
    "--source-only": [],
    "--mjcf": ["arm.xml"],
    "--usd": ["arm.usda", "--to", "usd"],
    "--parameter": ["d"],
    "--from": ["1.0"],
    "--lowest": ["1.0", "--highest", "9.0"],
    "--highest": ["9.0", "--lowest", "1.0"],
    "--steps": ["3"],
    "--amplitude": ["2.0"],
    "--input": ["u"],
    "--output": ["x"],
    "--trials": ["3"],
    "--trial": ["0"],
    "--design": ["laboratory"],
    "--campaign": ["elsewhere"],
    "--campaigns": ["a", "--keys", "b"],
    "--at": ["1,2"],
    "--floors": ["3"],
    "--junit": ["checks.xml"],
    "--keys": ["b", "--campaigns", "a"],
    "--merge": ["a"],
    "--diagnosis": ["results"],
    "--rivals": ["coulomb_friction,quadratic_damping"],
    "--limit": ["x=0.02"],
    "--seconds": ["7"],
    "--rescore": [],
    "--cluster": ["tcp://10.0.0.1:8786"],
    "--model": ["axis"],
    "--gear": ["elbow=500", "--mjcf", "arm.xml"],
    "--lock": ["elbow=0.5", "--mjcf", "arm.xml"],
    "--as-it-is": ["--mjcf", "arm.xml"],
    "--host": ["10.0.0.1"],
    "--port": ["8080"],
}
VALUES_OF = {
    ("gate", "--limit"): ["x=1 mm"],
    ("vary", "--to"): ["9.0"],
    ("export", "--out"): ["elsewhere.py"],
}
NOT_PASSED_ON = ("--simulator", "--markdown", "--picture", "--no-browser")
"""Used by the command itself: tests below and in `test_own_simulators`."""
REFUSED = {
    "identify": [
        ["--seed", "3"],
        ["--method", "thesis", "--resolution", "0.5"],
        ["--initial-samples", "50"],
        ["--objective", "free-run", "--effect", "bouc_wen_hysteresis"],
    ],
    "init": [
        ["--gear", "elbow=500"],
        ["--lock", "elbow=0.5"],
        ["--as-it-is"],
        ["--mjcf", "arm.xml", "--model", "axis"],
        ["--mjcf", "arm.xml", "--rigs", "own.toml"],
        ["--mjcf", "arm.xml", "--simulator", "own_motion.py:move"],
    ],
    "vary": [["--lowest", "1.0"], ["--highest", "1.0"], ["--parameter", "d", "--from", "1.0"]],
    "export": [
        ["--source-only"],
        ["--mjcf", "arm.xml"],
        ["--usd", "arm.usda"],
        ["--to", "latex", "--hold", "zoh"],
        ["--to", "c", "--step", "1e-3"],
    ],
    "blind": [
        ["--campaigns", "a"],
        ["--keys", "a"],
        ["--merge", "a", "--jobs", "3"],
        ["--merge", "a", "--cluster", "tcp://10.0.0.1:8786"],
        ["--merge", "a", "--seed", "3"],
        ["--rescore", "--trial", "3"],
        ["--cluster", "tcp://10.0.0.1:8786", "--jobs", "3"],
    ],
    "rigs": [["--picture", "a.png"]],
}
"""Options that exclude each other, or that would change nothing."""


class CalledError(InputError):
    """Ends a command where its work would begin."""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model = make_model("axis", {"m": 2.0, "d": 5.0, "k": 800.0})
    (tmp_path / "model.json").write_text(json.dumps(Model.to_json(model)))
    (tmp_path / "a.csv").write_text(
        "t,u,x\n" + "".join(f"{0.01 * i:.2f},{i % 7},{i % 5}\n" for i in range(200))
    )
    (tmp_path / "campaign.toml").write_text('[rig]\nmodel = "axis"\n[[records]]\nfile = "a.csv"\n')
    (tmp_path / "own_motion.py").write_text("def move(*given):\n    return given\n")
    (tmp_path / "own.py").write_text("")


@pytest.fixture
def call(run: Run, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any] | str]:
    """Return what a command line hands to the function that does the work, or the message of its refusal."""
    called: dict[str, Any] = {}

    def spy(name: str) -> Callable[..., None]:
        def record(*given: Any, **options: Any) -> None:
            named = {"function": name, "given": given, **options}
            called.update({key: repr(v) for key, v in named.items() if key not in ("command", "listener")})
            raise CalledError(name)

        return record

    for name in (*WORK.values(), *ELSEWHERE.values()):
        monkeypatch.setattr(name, spy(name))
    for own in ("own_effects", "own_rigs"):
        found = "own_effects.own_effects" if own == "own_effects" else "own_rigs.own_rigs"
        monkeypatch.setattr(
            f"rigsight.workflow.own.{found}",
            (lambda files, **_: list(files))
            if own == "own_effects"
            else (lambda files: dict(enumerate(files))),
        )

    def call(*line: str) -> dict[str, Any] | str:
        called.clear()
        code, _, err = run(*line)
        assert code == 2, err
        return dict(called) if called else err

    return call


def test_every_option_is_in_the_table() -> None:
    table = PAGE.split("## Options\n")[1].split("\n## ")[0]
    rows = [line.split("|")[1:3] for line in table.split("\n") if line.startswith("| `")]
    reported = {(command.strip(), option) for option, used in rows for command in used.split(",")}
    reported = {(command, option.strip().strip("`")) for command, option in reported}
    known = {
        (name, option) for name, options in OPTIONS.items() for option in options if option not in EVERYWHERE
    }
    assert reported == known, "add the command to the row of the option under 'Options' in docs/keys.md"


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (name, option)
        for name in WORK
        for option in OPTIONS[name]
        if option not in (*EVERYWHERE, *NOT_PASSED_ON)
    ],
)
def test_an_option_reaches_the_work_of_its_command(
    command: str, option: str, call: Callable[..., dict[str, Any] | str]
) -> None:
    assert option in GIVEN, f"add a value of {option} to GIVEN, and it to docs/keys.md"
    base = [command, *ARGUMENTS.get(command, [])]
    values = VALUES_OF.get((command, option), GIVEN[option])
    if command == "export" and option == "--mjcf":
        values = [*values, "--to", "mjcf"]
    without, given = call(*base), call(*base, option, *values)
    assert isinstance(without, dict), without
    assert isinstance(given, dict), given
    assert given != without


@pytest.mark.parametrize(
    ("command", "options"), [(command, options) for command, sets in REFUSED.items() for options in sets]
)
def test_options_without_an_effect_are_refused(
    command: str, options: list[str], run: Run, tmp_path: Path
) -> None:
    before = sorted(tmp_path.iterdir())
    code, out, err = run(command, *ARGUMENTS.get(command, []), *options)
    assert (code, out) == (2, ""), err
    assert any(option in err for option in options if option.startswith("--")) or "seed" in err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("command", [name for name in OPTIONS if "--simulator" in OPTIONS[name]])
def test_a_simulator_that_cannot_be_used_ends_every_command(command: str, run: Run) -> None:
    code, _, err = run(command, *ARGUMENTS.get(command, []), "--simulator", "gone.py:move")
    assert code == 2
    assert "gone.py" in err
