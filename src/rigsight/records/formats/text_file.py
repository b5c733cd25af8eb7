"""Reading a file as text after checking that it is text and fits into memory."""

from __future__ import annotations

from pathlib import Path

from rigsight.errors import InputError
from rigsight.records.formats.channel import MOST_SAMPLES
from rigsight.records.formats.ordinary_file import file_size

# The text and its lines are held in memory together, about five times the file.
LARGEST_FILE = 2_000_000_000
_PIECE = 1 << 20
_LONGEST_LINE = 1_000_000
_MOST_LINES = MOST_SAMPLES + 1000


def read_text(path: Path) -> str:
    """Return the text of a file with line feeds only."""
    size = file_size(path)
    if size > LARGEST_FILE:
        raise InputError(
            f"{path.name} has {size / 1e9:.1f} GB, more than the {LARGEST_FILE / 1e9:g} GB that are read; "
            "split it into several records or reduce the sample rate."
        )
    try:
        _check_text(path)
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _check_text(path: Path) -> None:
    """Refuse what is no text, or no table, piece by piece: all of it in memory takes several times the file."""
    n_lines, unbroken = 0, 0
    with path.open("rb") as file:
        head = file.read(4)
        wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
        file.seek(0)
        while piece := file.read(_PIECE):
            if (b"\x00" in piece and not wide) or head == b"PK\x03\x04":
                raise InputError(f"{path.name} is not a text file; export the record as CSV.")
            last = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
            unbroken = len(piece) - last - 1 if last >= 0 else unbroken + len(piece)
            n_lines += max(piece.count(b"\n"), piece.count(b"\r"))
            if unbroken > _LONGEST_LINE:
                raise InputError(
                    f"{path.name} has a line of more than {_LONGEST_LINE / 1e6:g} MB, the longest that is read; a record is a "
                    "table with one row per sample."
                )
            if n_lines > _MOST_LINES:
                raise InputError(
                    f"{path.name} has more than {_MOST_LINES} lines, the most that are read; split it into several records or "
                    "reduce the sample rate."
                )
