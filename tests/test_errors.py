"""A message can be read by somebody, whatever a file holds."""

from __future__ import annotations

import pytest

from rigsight.errors import LONGEST_MESSAGE, InputError, shown


def test_a_message_is_cut_in_its_middle() -> None:
    reported = str(InputError("run.csv: " + "x" * 1_000_000 + " Mend it."))
    assert len(reported) < LONGEST_MESSAGE + 10
    assert reported.startswith("run.csv: ")
    assert reported.endswith(" Mend it.")


@pytest.mark.parametrize("sign", ["\x1b[31m", "\x07", "\ud800", "\x9b"])
def test_what_a_message_quotes_does_not_reach_the_terminal_as_a_command(sign: str) -> None:
    reported = str(InputError(f"no channel '{sign}'\nnext line"))
    assert ascii(sign)[1:-1] in reported
    assert "\nnext line" in reported
    reported.encode()


def test_values_that_python_does_not_write_out_are_shown_by_their_type() -> None:
    assert shown(16**9000) == "a int too large to be shown"
    assert shown("a") == "'a'"
    assert len(shown("x" * 10_000)) < 400
