from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.campaign.read_campaign import read_campaign

from .campaign_text import HEAD, RECORDS, Lines


def test_a_campaign_is_read_whole(campaign: Callable[..., Path]) -> None:
    folder = campaign()
    read = read_campaign(folder)
    assert (read.title, read.rig.name, read.folder) == ("rear axle", "running_gear", folder)
    assert read.constants == {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
    assert read.parameters == {"J_z": 0.56}
    assert [record.name for record in read.estimation] == ["sweep"]
    (step,) = read.validation
    assert (step.kind, step.hold, step.role) == ("step", "zoh", "validation")
    assert list(step.signals) == ["u", "psi", "y"]
    assert read.notes == ()


def test_the_toml_file_may_be_named_instead_of_its_folder(campaign: Callable[..., Path]) -> None:
    folder = campaign()
    (folder / "campaign.toml").rename(folder / "other.toml")
    assert len(read_campaign(folder / "other.toml").records) == 2
    with pytest.raises(InputError, match=r"contains no campaign.toml. Name one of its files: other.toml"):
        read_campaign(folder)


def test_a_measured_file_is_no_campaign(campaign: Callable[..., Path]) -> None:
    measured = next(campaign().glob("*.csv"))
    with pytest.raises(
        InputError, match=rf"{measured.name} is a measured file, not a campaign.*rigsight init"
    ):
        read_campaign(measured)


def test_columns_and_dialect_come_from_the_record(tmp_path: Path, write_csv: Callable[..., Path]) -> None:
    t = 0.01 * np.arange(80)
    rows = np.column_stack([t, 1e3 * np.sin(t), np.cos(t)])
    write_csv(
        "log.txt", rows=rows, header=None, separator=";", change=lambda lines: lines.insert(0, "! remark")
    )
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nmodel = "element"\n[[records]]\nfile = "log.txt"\nname = "bench"\nseparator = ";"\ncomment = "!"\n'
        'header = false\ndecimal = "."\n[records.columns]\nt = 1\nx = { name = 2, scale = 1e-3 }\nforce = "3"\n'
    )
    (record,) = read_campaign(tmp_path).records
    assert record.name == "bench"
    np.testing.assert_allclose(record["x"], np.sin(t), atol=1e-9)
    np.testing.assert_allclose(record["force"], np.cos(t), atol=1e-9)


Bench = Callable[..., Path]


@pytest.fixture
def element(tmp_path: Path, write_csv: Callable[..., Path]) -> Bench:
    """Write a campaign of an element: its files by their heads, and the columns of each."""
    t = 0.01 * np.arange(80)
    rows = np.column_stack([t, np.sin(t), np.cos(t)])

    def write(*records: tuple[str, str]) -> Path:
        text = '[rig]\nmodel = "element"\n'
        for number, (head, columns) in enumerate(records):
            write_csv(f"{number}.csv", rows, head)
            text += f'[[records]]\nfile = "{number}.csv"\n[records.columns]\n{columns}\n'
        (tmp_path / "campaign.toml").write_text(text)
        return tmp_path

    return write


ROW = ("t,x,force\ns,deg,kN m", "")
IN_BRACKETS = ("t,x [deg],force [kN m]", 'x = "x [deg]"\nforce = "force [kN m]"')
BY_KEY = ("t,x,force", 'x = { name = "x", unit = "deg" }\nforce = { name = "force", unit = "kN m" }')
IN_SI = ("t,x,force", "")
ALONG_A_LINE = ("t,x,force\ns,mm,N", "")


@pytest.mark.parametrize("stated", [ROW, IN_BRACKETS, BY_KEY])
def test_an_element_turns_if_its_columns_say_so(element: Bench, stated: tuple[str, str]) -> None:
    read = read_campaign(element(IN_SI, stated))
    assert [record.units for record in read.records] == [{"t": "s", "x": "rad", "force": "N m"}] * 2
    first, second = read.records
    np.testing.assert_allclose(second["x"], np.radians(first["x"]), rtol=1e-8)
    np.testing.assert_allclose(second["force"], 1e3 * first["force"], rtol=1e-8)
    structure = compose(read.rig, [effect_named("cubic_stiffness")])
    model = model_of(Model(structure, dict.fromkeys(structure.names, 1.0), "foh").to_json())
    assert model.structure.rig is read.rig
    assert [p.unit for p in model.structure.parameters] == ["N m s/rad", "N m/rad", "N m", "N m/rad^3"]


def test_a_column_that_only_seems_to_be_an_angle_chooses_the_unit_and_is_not_converted(
    element: Bench,
) -> None:
    (record,) = read_campaign(element(("t,x_deg,force", 'x = "x_deg"'))).records
    assert (record.units["x"], record.units["force"]) == ("rad", "N m")
    np.testing.assert_allclose(record["x"], np.sin(0.01 * np.arange(80)), atol=1e-9)
    assert [("x_deg" in note, "'force'" in note) for note in record.notes] == [(False, True), (True, False)]


@pytest.mark.parametrize(
    ("records", "message"),
    [
        (
            [("t,x,force\ns,rad,N", "")],
            r"x in rad, force in N\. .*: x in m, force in N; or x in rad, force in N m\.",
        ),
        ([ROW, ALONG_A_LINE], r"1\.csv, column 'x': the unit 'mm'.* those of '0': x in rad, force in N m\."),
    ],
)
def test_angles_and_lengths_do_not_go_together(
    element: Bench, records: list[tuple[str, str]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read_campaign(element(*records))


def test_constants_with_a_default_may_be_left_out(tmp_path: Path, write_csv: Callable[..., Path]) -> None:
    write_csv(header="t,u,x,y")
    (tmp_path / "campaign.toml").write_text('[rig]\nmodel = "axis"\n[[records]]\nfile = "sweep.csv"\n')
    read = read_campaign(tmp_path)
    assert read.constants == {"gain": 1.0}
    assert 'no record has role = "validation"' in read.notes[0]


def test_conicity_passes_instead_of_the_creep_factor(campaign: Callable[..., Path]) -> None:
    text = (HEAD + RECORDS).replace("J_z = 0.56", "delta_0 = 0.02")
    assert read_campaign(campaign(text)).parameters == {"delta_0": 0.02}


def test_records_of_one_file_get_names_of_their_own(campaign: Callable[..., Path]) -> None:
    text = (
        HEAD + RECORDS + '[[records]]\nfile = "sweep.csv"\n[[records]]\nfile = "step.csv"\nname = "sweep_2"\n'
    )
    names = [record.name for record in read_campaign(campaign(text)).records]
    assert len(set(names)) == 4
    assert names[0] == "sweep"
    assert names[3] == "sweep_2"


def test_third_party_campaigns_read_without_a_repair(shared_data: Path) -> None:
    files = sorted(shared_data.glob("*/*.toml"))
    assert files
    for file in files:
        read = read_campaign(file)
        assert read.estimation
        assert read.validation
        assert [note for record in read.records for note in record.notes] == []


BROKEN: list[tuple[str, str, str, list[str]]] = [
    ("syntax", "v = 1.0", "v = ", ["line 6", "column", "TOML"]),
    ("unknown key at the top", 'title = "', 'titel = "', ["titel", "unknown key", "'title'"]),
    ("unknown key in rig", "[rig.constants]", "[rig.constant]", ["rig.constant", "Did you mean 'constants'"]),
    ("unknown key in record", "hold =", "holds =", ["record 2 (step.csv): holds", "Did you mean 'hold'"]),
    ("model missing", 'model = "running_gear"', "", ["rig.model", "missing"]),
    (
        "model unknown",
        '"running_gear"',
        '"runing_gear"',
        ["rig.model", "Did you mean 'running_gear'", "axis"],
    ),
    ("constant missing", "k_tau = 0.27", "", ["rig.constants.k_tau", "missing", "N m/A"]),
    ("constant unknown", "k_tau = 0.27", "k_tua = 0.27", ["rig.constants.k_tua", "Did you mean 'k_tau'"]),
    (
        "constant as text",
        "k_tau = 0.27",
        'k_tau = "0.27"',
        ["rig.constants.k_tau", "must be a number", "without quotes"],
    ),
    ("constant as truth value", "k_tau = 0.27", "k_tau = true", ["rig.constants.k_tau", "must be a number"]),
    ("constant zero", "k_tau = 0.27", "k_tau = 0.0", ["rig.constants.k_tau"]),
    ("constant NaN", "k_tau = 0.27", "k_tau = nan", ["rig.constants.k_tau", "finite"]),
    ("constant out of range", "r_0 = 0.1", "r_0 = -0.1", ["rig.constants.r_0", "must lie in", "got -0.1"]),
    ("parameter unknown", "J_z = 0.56", "J_zz = 0.56", ["rig.parameters.J_zz", "Did you mean 'J_z'"]),
    ("parameter out of range", "J_z = 0.56", "J_z = -1.0", ["rig.parameters.J_z", "got -1"]),
    (
        "parameter twice",
        "J_z = 0.56",
        "c_y = 0.9\ndelta_0 = 0.1",
        ["rig.parameters.delta_0", "c_y", "one of the two"],
    ),
    ("no records", RECORDS, "", ["records", "missing", "[[records]]"]),
    ("empty records", RECORDS, "", ["records: 0 given, 1 to 1000"]),
    ("records no list", "[[records]]\nfile", "[records]\nfile", ["campaign.toml", "begins with [[records]]"]),
    ("path of Windows", '"sweep.csv"', '"C:\\data.csv"', ["campaign.toml", "a path with /"]),
    ("file missing", 'file = "sweep.csv"', "", ["record 1: file", "missing"]),
    (
        "file not there",
        '"sweep.csv"',
        '"sweeps.csv"',
        ["record 1: file", "does not exist", "Did you mean 'sweep.csv'"],
    ),
    (
        "absolute file",
        '"sweep.csv"',
        '"/etc/passwd"',
        ["record 1: file", "lies outside the campaign's folder"],
    ),
    ("file above", '"sweep.csv"', '"../sweep.csv"', ["record 1: file", "lies outside the campaign's folder"]),
    ("file is a folder", '"sweep.csv"', '"."', ["record 1: file", "does not exist"]),
    (
        "role unknown",
        '"validation"',
        '"validate"',
        ["record 2 (step.csv): role", "Did you mean 'validation'"],
    ),
    ("kind unknown", '"step"', '"jump"', ["record 2 (step.csv): kind", "'multisine'"]),
    ("hold unknown", '"zoh"', '"ZOH"', ["record 2 (step.csv): hold", "'foh'"]),
    ("amplitude as text", "0.25", '"0.25 A"', ["record 1 (sweep.csv): amplitude", "must be a number"]),
    ("nothing to fit", 'kind = "sweep"', 'role = "validation"', ['none has role = "estimation"']),
    (
        "column signal unknown",
        "amplitude = 0.25",
        'columns = { phi = "psi" }',
        ["record 1 (sweep.csv): columns.phi", "psi"],
    ),
    (
        "column not there",
        "amplitude = 0.25",
        'columns = { u = "i" }',
        ["record 1", "sweep.csv has no column 'i'", "'psi'"],
    ),
    (
        "column key unknown",
        "amplitude = 0.25",
        'columns = { u = { name = "u", scal = 2.0 } }',
        ["columns.u.scal", "'scale'"],
    ),
    (
        "column of no use",
        "amplitude = 0.25",
        "columns = { u = true }",
        ["columns.u", "number counted from 1"],
    ),
    (
        "scale zero",
        "amplitude = 0.25",
        'columns = { u = { name = "u", scale = 0 } }',
        ["columns.u", "other than 0"],
    ),
    ("decimal unknown", "amplitude = 0.25", 'decimal = ";"', ["record 1 (sweep.csv): decimal", '"." or ","']),
    (
        "separator too long",
        "amplitude = 0.25",
        'separator = "tab"',
        ["record 1 (sweep.csv): separator", "one character"],
    ),
]


@pytest.mark.parametrize(
    ("old", "new", "reported"), [case[1:] for case in BROKEN], ids=[case[0] for case in BROKEN]
)
def test_broken_campaigns_are_told_with_key_and_mend(
    campaign: Callable[..., Path], old: str, new: str, reported: list[str], request: pytest.FixtureRequest
) -> None:
    text = HEAD + RECORDS
    assert old in text
    text = text.replace(old, new)
    if request.node.callspec.id == "empty records":
        text = "records = []\n" + text
    folder = campaign(text)
    with pytest.raises(InputError) as caught:
        read_campaign(folder)
    message = str(caught.value)
    for fragment in ["campaign.toml", *reported]:
        assert fragment in message
    assert len(message.splitlines()) == 1
    assert "pydantic" not in message


def test_a_gain_of_zero_is_refused(tmp_path: Path, write_csv: Callable[..., Path]) -> None:
    write_csv("run.csv", header="t,u,x,y")
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nmodel = "axis"\n[rig.constants]\ngain = 0\n[[records]]\nfile = "run.csv"\n', "utf-8"
    )
    with pytest.raises(InputError, match=r"rig.constants.gain: is 0"):
        read_campaign(tmp_path)


def test_errors_of_a_record_name_campaign_file_and_line(campaign: Callable[..., Path]) -> None:
    def change(lines: Lines) -> None:
        lines[7] = lines[7].replace(lines[7].split(",")[1], "off")

    with pytest.raises(
        InputError, match=r"campaign.toml, line 13, column 1: record 1: sweep.csv, line 8, column 'u': 'off'"
    ):
        read_campaign(campaign(change=change))


def test_a_column_that_is_no_signal_is_told_with_its_own_line(campaign: Callable[..., Path]) -> None:
    folder = campaign()
    toml = folder / "campaign.toml"
    lines = [*toml.read_text().rstrip("\n").split("\n"), "", "[records.columns]", 'force = "u"', ""]
    toml.write_text("\n".join(lines))
    number = lines.index('force = "u"') + 1
    with pytest.raises(
        InputError,
        match=rf"campaign.toml, line {number}, column 9: record .*: columns.force: is not a signal",
    ):
        read_campaign(folder)


def test_a_link_that_leaves_the_folder_is_refused(
    campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = campaign()
    outside = tmp_path_factory.mktemp("elsewhere") / "sweep.csv"
    (folder / "sweep.csv").rename(outside)
    (folder / "sweep.csv").symlink_to(outside)
    with pytest.raises(InputError, match="is a link to a file outside the campaign's folder"):
        read_campaign(folder)


def test_missing_empty_and_unreadable_campaigns_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_campaign(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"contains no campaign\.toml"):
        read_campaign(tmp_path)
    (tmp_path / "campaign.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8"):
        read_campaign(tmp_path)
    (tmp_path / "campaign.toml").write_text("")
    with pytest.raises(InputError, match=r"rig: is missing.*\n.*records: is missing"):
        read_campaign(tmp_path)


def test_time_is_no_signal(campaign: Callable[..., Path]) -> None:
    folder = campaign(HEAD + RECORDS + '[records.columns]\nu = "t"\n')
    with pytest.raises(InputError, match=r"step\.csv: u and t are both read from column 't'"):
        read_campaign(folder)


def test_what_a_rig_does_not_know_is_told_with_line_and_column(campaign: Callable[..., Path]) -> None:
    text = (HEAD + RECORDS).replace("b = 0.3", "bb = 0.3")
    line = 1 + text.splitlines().index("bb = 0.3")
    folder = campaign(text)
    reported = (
        rf"campaign.toml, line {line}, column 6: rig.constants.bb: unknown to running_gear. Did you mean 'b'"
    )
    with pytest.raises(InputError, match=reported):
        read_campaign(folder)


@pytest.mark.parametrize(
    ("moved", "before", "reported"),
    [
        (
            "b = 0.3",
            "J_z = 0.56",
            "rig.parameters.b: unknown to .*It is a constant: give it under rig.constants.",
        ),
        (
            "J_z = 0.56",
            "b = 0.3",
            "rig.constants.J_z: unknown to .*It is a parameter: give it under rig.parameters.",
        ),
    ],
)
def test_a_number_in_the_table_of_the_others_is_told(
    moved: str, before: str, reported: str, campaign: Callable[..., Path]
) -> None:
    text = (HEAD + RECORDS).replace(f"{moved}\n", "").replace(before, f"{before}\n{moved}")
    with pytest.raises(InputError, match=reported):
        read_campaign(campaign(text))


def test_what_is_missing_is_told_with_the_line_of_its_table(campaign: Callable[..., Path]) -> None:
    text = (HEAD + RECORDS).replace("b = 0.3\n", "")
    line = 1 + text.splitlines().index("[rig.constants]")
    with pytest.raises(InputError, match=rf"line {line}, column 1: rig.constants.b: is missing"):
        read_campaign(campaign(text))
