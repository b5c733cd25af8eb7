"""How does an error become one message on stderr and an exit code?

Exit codes: 0 success, 1 a defect of rigsight, 2 input that cannot be used, 130 interrupted.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from typing import NoReturn

import typer

from rigsight.errors import RigsightError

DEFECT, BAD_INPUT, INTERRUPTED = 1, 2, 130
GOES_ON = "nothing was written; the same command goes on from there"
"""What an interrupted diagnosis leaves: no file, but the fits that it has done."""


@contextlib.contextmanager
def told(debug: bool, left: str = "nothing was written") -> Iterator[None]:
    """Map errors of a command to one message on stderr and an exit code.

    Parameters
    ----------
    debug
        If True, errors pass with their traceback.
    left
        What an interruption leaves behind, for its message.

    Raises
    ------
    SystemExit
        With the exit code, after an error.
    """
    if debug:
        yield
        return
    try:
        with warnings.catch_warnings():
            # Trial parameters far off the mark overflow; fits expect that and go elsewhere.
            warnings.simplefilter("ignore")
            yield
    except RigsightError as error:
        leave(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        leave(f"interrupted; {left}.", INTERRUPTED)
    except BrokenPipeError:
        raise
    except MemoryError:
        leave("this needs more memory than there is. Shorten the records, or lower --jobs.", BAD_INPUT)
    except Exception as error:
        text = " ".join(str(error).split())[:300]
        leave(
            f"a defect of rigsight, not of your data: {type(error).__name__}: {text}. "
            "Please report it with the output of the same command with --debug added.",
            DEFECT,
        )


def leave(message: str, code: int) -> NoReturn:
    """Say on stderr why the command ends, and end it.

    Raises
    ------
    SystemExit
        Always, with the exit code.
    """
    typer.echo(f"rigsight: {message}", err=True)
    raise SystemExit(code)
