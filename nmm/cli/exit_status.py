"""How a command line ends: every error becomes one line and an exit status, whatever the streams lead to."""

import errno
import gc
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

import typer

from nmm.base.errors import InputError, NmmError, RunError
from nmm.cli.app import app
from nmm.cli.interrupts import ignore_interrupts, raise_interrupts
from nmm.cli.output import BAD_INPUT, FAILED, INTERRUPTED, OK, complain, tell_what_takes_long

#: What typer raises for wrong usage: options that do not exist, arguments that are missing.
_USAGE_ERROR: type[Exception] = typer.BadParameter.mro()[2]

#: Commands whose exit status is that of a run.
TELLING = ("run", "compare", "laps", "paper", "sweep")


def status_of(arguments: Sequence[str]) -> int:
    """Run the command line; every user error is one line on standard error.

    Returns 0; 1 for a failed run; 2 for bad input; 130 for Ctrl-C where there is nothing to write.
    """
    prefix = _called(arguments)
    try:
        result = app(args=list(arguments), prog_name="nmm", standalone_mode=False)
        _flush()
        if result == INTERRUPTED:
            return _complain(prefix, "interrupted", INTERRUPTED)
        return result if isinstance(result, int) else OK
    except KeyboardInterrupt:
        return _complain(prefix, "interrupted", INTERRUPTED)
    except (BrokenPipeError, SystemExit):  # typer makes the latter of the former
        _discard_output()
        if prefix.rpartition(" ")[2] not in TELLING:  # the reader has seen enough
            return OK
        return _complain(prefix, "nobody reads the output any more; what is written is whole", FAILED)
    except InputError as error:
        return _complain(prefix, str(error), BAD_INPUT)
    except NmmError as error:
        return _complain(prefix, str(error), FAILED)
    except typer.Abort as error:
        if isinstance(error.__cause__, EOFError):
            return _complain(prefix, "what was read ended too early", FAILED)
        return _complain(prefix, "interrupted", INTERRUPTED)
    except MemoryError:
        return _complain(prefix, "there is not enough memory for this", FAILED)
    except _USAGE_ERROR as error:
        message = error.format_message() if hasattr(error, "format_message") else str(error)
        return _complain(prefix, f"{message} (see {prefix} --help)", BAD_INPUT)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return _complain(prefix, f"{error.filename}: {error.strerror}", BAD_INPUT)
        if error.filename is None:
            _discard_output()  # it may have been that: nothing of it is tried again at the end
        what = "cannot write or read" if error.filename is None else error.filename
        if error.errno == errno.ENOENT and not _is_somewhere():
            what = "the working directory is gone"
        return _complain(prefix, f"{what}: {error.strerror or error}", FAILED)


def _is_somewhere() -> bool:
    try:
        return bool(os.getcwd())
    except OSError:
        return False


def _called(arguments: Sequence[str]) -> str:
    names = [
        command.name or command.callback.__name__ for command in app.registered_commands if command.callback
    ]
    return f"nmm {arguments[0]}" if arguments and arguments[0] in names else "nmm"


def _complain(prefix: str, text: str, status: int) -> int:
    complain(prefix, text)
    return status


def _flush() -> None:
    """What is printed goes out; `RunError` where it cannot (a full disk)."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _discard_output()
        raise RunError(f"cannot be written: {error.strerror}", where="the output") from None


def _discard_output() -> None:
    """The reader of our output has gone (`nmm info | head -1`): write the rest to nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _open_streams() -> None:
    """Streams that were closed (`nmm info >&-`) go nowhere: the next file opened would be taken for them."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            while (handle := os.open(os.devnull, os.O_RDWR)) < number:
                pass
            setattr(sys, name, os.fdopen(handle, "w" if number else "r", encoding="utf-8"))


def main() -> NoReturn:
    _open_streams()
    # The figures' look is ours: neither a backend that is none nor faults of the user's settings matter.
    os.environ["MPLBACKEND"], os.environ["MATPLOTLIBRC"] = "agg", os.devnull
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that knows no Greek gets "?"
    # The libraries' objects stay: looking through them for garbage, again and again and once more at the
    # end, is a fifth of a short run's time.
    gc.set_threshold(1_000_000, 50, 50)
    tell_what_takes_long()
    status: int | None = None
    try:
        raise_interrupts()
        status = status_of(sys.argv[1:])
        ignore_interrupts()
    except KeyboardInterrupt:  # just before, or just behind: then it is done
        ignore_interrupts()
        if status is None:
            status = _complain(_called(sys.argv[1:]), "interrupted", INTERRUPTED)
    gc.freeze()
    sys.exit(status)
