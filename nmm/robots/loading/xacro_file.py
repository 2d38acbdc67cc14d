"""xacro in this process: its global state behind one lock, its failures as one-line errors.

A xacro file is a program (`${...}` are Python expressions): load only files that you would run.
"""

from __future__ import annotations

import io
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from pathlib import Path
from typing import Any

from nmm.errors import RobotError, unknown
from nmm.robots.loading.packages import Packages
from nmm.robots.loading.text import read_text
from nmm.robots.loading.xml_tree import XmlError, parse
from nmm.words import one_line

# xacro keeps its stacks, arguments and verbosity in module globals.
_LOCK = threading.RLock()


def expand(
    path: Path, arguments: Mapping[str, str], packages: Packages
) -> tuple[str, dict[str, str], tuple[str, ...]]:
    """Expand a xacro file.

    Parameters
    ----------
    path : the file
    arguments : values for its `xacro:arg`s
    packages : resolves `$(find pkg)`

    Returns
    -------
    xml : the expanded text
    arguments : every argument that the file declares, with the value used
    warnings : what xacro would have printed

    Raises
    ------
    RobotError : whatever is wrong, with the file and the cause
    """
    import xacro  # 10 ms, and a URDF needs none of it
    import xacro.substitution_args

    given = _Arguments(arguments)
    printed = io.StringIO()
    with _LOCK, _patched(xacro, packages), redirect_stderr(printed):
        try:
            document = xacro.process_file(str(path), mappings=given)
            xml = document.toxml()
        # Expressions in the file may raise anything, and so may xacro on what they return.
        except Exception as error:
            raise _explained(error, path, xacro) from None
        finally:
            xacro.substitution_args_context["arg"] = {}
            xacro.init_stacks(None)
    for name in arguments:
        if name not in given.declared:
            raise RobotError(unknown("xacro argument", name, given.declared, str(path)))
    warnings = [line for line in printed.getvalue().splitlines() if line.startswith("warning: ")]
    return str(xml), {name: given[name] for name in given.declared}, tuple(dict.fromkeys(warnings))


class _Arguments(dict[str, str]):
    """xacro's table of arguments, which remembers the names that the file asks for.

    So includes with computed names and conditional arguments count as xacro really meets them.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.declared: dict[str, None] = {}

    def __contains__(self, name: object) -> bool:
        # `xacro:arg` asks whether the caller gave a value before it sets the default.
        self.declared[str(name)] = None
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        # `$(arg name)` without `xacro:arg` takes a given value, too.
        value = super().__getitem__(name)
        self.declared[name] = None
        return value


@contextmanager
def _patched(xacro: Any, packages: Packages) -> Iterator[None]:
    """xacro with our reading of files, our package search, and less to say."""
    substitution = xacro.substitution_args

    def find(package: str) -> str:
        folder = packages.find(package)
        if folder is None:
            raise RobotError(
                f"{_where(packages.file, xacro)}: $(find {package}): package {package!r} not found "
                "(give its folder in package_dirs, --package-dir)"
            )
        return str(folder)

    saved = (xacro.parse, substitution._eval_find, xacro.all_includes, xacro.verbosity)
    xacro.parse, substitution._eval_find = _reader(xacro, packages.file, saved[0]), find
    xacro.all_includes, xacro.verbosity = [], 0
    try:
        yield
    finally:
        xacro.parse, substitution._eval_find, xacro.all_includes, xacro.verbosity = saved


def _reader(xacro: Any, main: Path, original: Callable[..., Any]) -> Callable[..., Any]:
    """`xacro.parse`, which reads UTF-8 in any locale and refuses a DOCTYPE before anything is expanded."""

    def read(text: Any, filename: str | None = None) -> Any:
        if text is not None or filename is None:
            return original(text, filename)
        including = "" if Path(filename) == main else f"{main}: included "
        try:
            content = read_text(Path(filename))
            parse(content)
        except FileNotFoundError as error:
            xacro.filestack.pop()  # as xacro does: the error is the including file's
            raise xacro.XacroException(
                f"included file {filename} does not exist", exc=_Missing(error)
            ) from None
        except RobotError as error:
            raise RobotError(f"{including}{error}") from None
        except XmlError as error:
            line = "" if error.line is None else f"line {error.line}: "
            raise RobotError(f"{including}{filename}: {line}{error}") from None
        return original(content)

    return read


class _Missing(OSError):
    """Missing file, by which xacro knows that an optional include may be left out; says nothing twice."""

    def __str__(self) -> str:
        return ""


def _where(path: Path, xacro: Any) -> str:
    """The file that the user named, and the included one that xacro was reading."""
    inner = xacro.filestack[-1] if xacro.filestack else None
    return str(path) if inner is None or Path(inner) == path else f"{path}: in {inner}"


def _explained(error: BaseException, path: Path, xacro: Any) -> RobotError:
    """The innermost cause in one line; xacro wraps it once for each expression around it."""
    while isinstance(getattr(error, "exc", None), xacro.XacroException | RobotError):
        error = error.exc  # type: ignore[attr-defined]  # XacroException has it, as just asked
    if isinstance(error, RobotError):
        return error
    missing = getattr(error, "exc", None)
    if isinstance(missing, xacro.substitution_args.ArgException):
        cause = f"xacro argument {str(missing)!r} has no default and was not given a value"
    elif isinstance(error, RecursionError) or isinstance(missing, RecursionError):
        cause = "xacro: recursion without end (a file that includes itself, or a macro that calls itself)"
    elif str(error).startswith("<class "):
        # What a $(...) raised, which xacro says twice, and its type.
        cause = f"xacro: {one_line(str(missing))}"
    else:
        cause = f"xacro: {one_line(str(error)) or type(error).__name__}"
    return RobotError(f"{_where(path, xacro)}: {cause}")
