"""Errors and termination signals become one message on stderr and an exit code.

Exit codes: 0 success; 1 a defect of rigsight, or a closed gate; 2 unusable input, or results that cannot be written; 130 Ctrl-C;
143 ended by kill; 129 the terminal was closed; 141 the output is no longer read.
"""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import NoReturn

import typer

from rigsight.errors import MachineError, RigsightError, shown
from rigsight.workflow.run.results import ENDING_SIGNALS, noting_folders

DEFECT, BAD_INPUT, UNREAD = 1, 2, 141
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EACCES, errno.EPERM)
_OF_A_PATH = (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR)
_OF_THE_SESSION = (errno.EMFILE, errno.ENFILE, errno.EFBIG)
_MOST_NAMED = 3
"""Largest number of result folders that an interruption lists by name; a bench has hundreds."""
NOTHING = "nothing was written"
GOES_ON = f"{NOTHING}; the same command continues from there"
"""Of an interrupted diagnosis no result file remains, but the finished fits are kept."""


@contextlib.contextmanager
def report_errors(debug: bool, outcome: str = NOTHING) -> Iterator[None]:
    """Map errors of a command to one message on stderr and an exit code."""
    if debug:
        yield
        return
    with noting_folders() as written:
        try:
            with warnings.catch_warnings():
                # Fits try parameter values at which a simulation overflows; they handle this themselves.
                warnings.simplefilter("ignore")
                yield
        except RigsightError as error:
            leave(str(error), BAD_INPUT, isinstance(error, MachineError))
        except KeyboardInterrupt as error:
            if written and outcome.startswith(NOTHING):
                outcome = f"the files written in {_named(written)} are complete"
            leave(f"interrupted; {outcome}.", exit_code(error))
        except BrokenPipeError:
            raise
        except OSError as error:
            if error.errno in _OF_THE_SESSION:
                leave(
                    f"a resource limit of this session was reached: {error.strerror}. Raise it (ulimit -a lists them); "
                    f"{outcome}.",
                    BAD_INPUT,
                    is_of_the_machine=True,
                )
            if error.errno in _OF_A_PATH and error.filename:
                leave(f"{shown(error.filename)} cannot be used: {error.strerror}. Check the path.", BAD_INPUT)
            # Only a search for a temporary folder names no file.
            is_without_folder = error.errno == errno.ENOENT and error.filename is None
            if error.errno not in _OF_THE_DISK and not is_without_folder:
                _leave_defect(error)
            # Result files have messages of their own; here remain input files and temporary files.
            if error.errno in (errno.EACCES, errno.EPERM) and error.filename:
                leave(
                    f"no permission to read or write {error.filename}. Change its permissions; {outcome}.",
                    BAD_INPUT,
                )
            place = f" ({error.filename})" if error.filename else ""
            leave(
                f"a temporary file or the output cannot be written{place}: {error.strerror}. Free disk space, or set TMPDIR to a "
                f"writable folder; {outcome}.",
                BAD_INPUT,
                is_of_the_machine=True,
            )
        except MemoryError:
            message = "not enough memory. Shorten the records, or lower --jobs."
            leave(message, BAD_INPUT, is_of_the_machine=True)
        except Exception as error:
            _leave_defect(error)


class CommandExit(SystemExit):
    """The process ends after its message was printed."""

    def __init__(self, code: int, is_of_the_machine: bool = False) -> None:
        super().__init__(code)
        self.is_of_the_machine = is_of_the_machine


def _leave_defect(error: Exception) -> NoReturn:
    text = " ".join(str(error).split())[:300]
    leave(
        f"a defect of rigsight, not of your data: {type(error).__name__}: {text}. "
        "Please report it with the output of the same command with --debug added.",
        DEFECT,
    )


@contextlib.contextmanager
def report_output_errors() -> Iterator[None]:
    """Map errors outside `report_errors`, while a finished command prints its results, to a message and an exit code."""
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()
    except CommandExit:
        raise
    except SystemExit as leaving:
        # The parser exits with 130 for every KeyboardInterrupt and with 1 for a closed pipe; the cause is in the context.
        behind = leaving.__context__.__cause__ if leaving.__context__ is not None else None
        if isinstance(behind, KeyboardInterrupt):
            leave("interrupted.", exit_code(behind))
        if isinstance(leaving.__context__, BrokenPipeError):
            _leave_unread()
        raise
    except KeyboardInterrupt as error:
        leave("interrupted.", exit_code(error))
    except BrokenPipeError:
        _leave_unread()
    except OSError as error:
        if "--debug" in sys.argv:
            raise
        _forget_output()
        leave(
            f"the output cannot be printed: {error.strerror}. The result files are complete.",
            BAD_INPUT,
        )


def _named(folders: Iterable[Path]) -> str:
    """Return a list of folders as text; many are replaced by their number and common parent folder."""
    names = sorted({str(folder) for folder in folders})
    if len(names) <= _MOST_NAMED:
        return ", ".join(names)
    # Some paths may be relative and others absolute.
    return f"{len(names)} folders in {os.path.commonpath([Path(name).absolute() for name in names])}"


def _leave_unread() -> NoReturn:
    _forget_output()
    raise CommandExit(UNREAD)


def _forget_output() -> None:
    """Redirect stdout to the null device, so that the interpreter prints no error when it exits."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def leave(message: str, code: int, is_of_the_machine: bool = False) -> NoReturn:
    """Print on stderr why the command ends, and end it."""
    with contextlib.suppress(OSError):
        typer.echo(f"rigsight: {message}", err=True)
    raise CommandExit(code, is_of_the_machine)


class Ended(KeyboardInterrupt):
    """The process was asked to end, by kill or because its terminal was closed; it cleans up as after Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Raise `Ended` on termination signals and Ctrl-C, except on signals that are ignored, as under nohup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # A program that runs the command line inside itself may have handlers of its own.
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    mine = {number: handler for number, handler in before.items() if handler in usual}
    for number in mine:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number, handler in mine.items():
            signal.signal(number, handler)


def exit_code(error: BaseException | None) -> int:
    """Return the exit code after an interruption: 128 plus the number of its signal, 130 for Ctrl-C."""
    return 128 + (error.number if isinstance(error, Ended) else int(signal.SIGINT))


def _end(number: int, _: FrameType | None) -> None:
    raise Ended(number)
