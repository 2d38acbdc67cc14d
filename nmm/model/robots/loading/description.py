"""A robot description: the URDF text of a .urdf, .xacro or .xml file, expanded here, and its packages.

A xacro file is a program (`${...}` are Python expressions): what it may do is in trust.py and expressions.py.
"""

import io
import os
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np

from nmm.base.errors import RobotError, expect_known
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.base.text_format import listed, one_line
from nmm.model.robots.loading.budget import STEPS_OF_A_FILE, Budget, RefusedContent
from nmm.model.robots.loading.mjcf import Converted, urdf_of
from nmm.model.robots.loading.packages import Packages
from nmm.model.robots.loading.trust import check_readable
from nmm.model.robots.loading.xacro_functions import replacements
from nmm.model.robots.loading.xml_tree import Element, XmlError, parse, read_text

SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf")
#: Robots in other languages, by their files' suffixes.
_OTHERS = {".sdf": "SDF", ".usd": "USD", ".usda": "USD"}
_LINK = re.compile(r"<link\b")
#: What xacro gives a meaning to in any file; calls of macros alone may be left over.
_XACRO = re.compile(r"<xacro:(?:include|macro|property|arg|if|unless)\b|\$\((?:find|arg|env|optenv|eval) ")
# xacro keeps its stacks, arguments and verbosity in module globals.
_LOCK = threading.RLock()


@dataclass(frozen=True)
class Description:
    """The text read from `path`; `expanded` by xacro, its lines are not the file's. `arguments` are the
    xacro arguments used, defaults included; `notes` xacro's warnings, or what is left out of an MJCF file;
    `mjcf` what such a file says."""

    xml: str
    path: Path
    packages: Packages
    expanded: bool = False
    arguments: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[Finding, ...] = ()
    mjcf: Converted | None = None

    @property
    def urdf(self) -> str | Element:
        """The URDF's text, or its <robot>, whose elements have the lines of the MJCF file."""
        return self.xml if self.mjcf is None else self.mjcf.urdf

    def placed(self, findings: Iterable[Finding]) -> list[Finding]:
        """Findings in its text, without their lines where these are not the file's."""
        return [replace(finding, where={}) if self.expanded else finding for finding in findings]


def describe(
    path: str | Path, arguments: Mapping[str, object] | None = None, package_dirs: Sequence[str | Path] = ()
) -> Description:
    """Reads a .urdf, .xacro or .urdf.xacro file, and expands xacro in any; `RobotError` if unreadable, or for
    an unknown argument."""
    file = Path(os.path.expanduser(path))  # pathlib's raises when there is no such user
    texts = argument_texts(arguments)
    _check_file(file)
    packages = Packages(file, package_dirs)
    text = None if file.suffix.lower() == ".xacro" else read_text(file)
    if text is None or _XACRO.search(_without_comments(text)):
        xml, used, warnings = expand(file.absolute(), texts, packages)
        call = None if _LINK.search(xml) else _call_of_macro(file, texts)
        if call is not None:
            xml, used, warnings = expand(file.absolute(), texts, packages, call)
            used |= {name: text for name, text in texts.items() if name in call.attrib}
        for name in texts:
            expect_known("xacro argument", name, used, file, RobotError)
        notes = tuple(Finding("xacro_warned", {"text": text}) for text in warnings)
        if "<mujoco" in xml:
            packages.mesh_folder = _mesh_folder(parse(xml))
        return Description(xml, file, packages, expanded=True, arguments=used, notes=notes)
    if texts:
        what = f"arguments ({', '.join(texts)}) are for .xacro files, others have none"
        raise RobotError(what, where=file)
    if "<mujoco" in text:
        try:
            root = parse(text)
        except XmlError as error:
            raise refusal(file, error.finding) from None
        if root.tag == "mujoco":
            mjcf = urdf_of(root, file)
            return Description(text, file, packages, notes=mjcf.notes, mjcf=mjcf)
        packages.mesh_folder = _mesh_folder(root)
    return Description(text, file, packages)


def _mesh_folder(root: Element) -> str | None:
    """The folder of the meshes that a URDF names to MuJoCo, if it does."""
    compiler = root.find("mujoco/compiler")
    return None if compiler is None else compiler.get("meshdir", compiler.get("assetdir"))


def _without_comments(text: str) -> str:
    first, *others = text.split("<!--")
    return first + "".join(part.partition("-->")[2] for part in others)


def _call_of_macro(file: Path, texts: Mapping[str, str]) -> ElementTree.Element | None:
    """The call of a file's one macro, with those of the texts that it takes; None without macros.
    `RobotError` for several, and for parameters without a value."""
    import xacro

    try:
        macros = [macro for macro in parse(read_text(file)).iter("xacro:macro") if macro.get("name")]
    except XmlError:
        return None
    parameters = {
        macro.get("name", "").removeprefix("xacro:"): macro.get("params", "").strip() for macro in macros
    }
    if len(parameters) > 1:
        raise refusal(file, Finding("only_macros", {"name": file.name, "macros": parameters}))
    for macro, rest in parameters.items():
        attributes, missing = {}, []
        while rest:
            name, default, rest = xacro.parse_macro_arg(rest)
            if name in texts:
                attributes[name] = texts[name]
            elif default is None:
                missing.append(name)
        if missing:
            values = {"macro": macro, "missing": missing, "name": file.name}
            raise refusal(file, Finding("macro_parameters_missing", values))
        return ElementTree.Element(f"xacro:{macro}", attributes)
    return None


def argument_texts(arguments: Mapping[str, object] | None) -> dict[str, str]:
    """The arguments as xacro wants them: text, booleans as true and false; `RobotError` for others."""
    if arguments is not None and not isinstance(arguments, Mapping):
        raise RobotError(where="arguments", expected="a value for each name", got=arguments)
    texts: dict[str, str] = {}
    for name, value in (arguments or {}).items():
        if not isinstance(name, str):
            raise RobotError(where="arguments", expected="names as strings", got=name)
        if not isinstance(value, str | int | float | np.bool_ | np.integer | np.floating):
            expected = "a string, a number or a boolean"
            raise RobotError(where=f"arguments: {name}", expected=expected, got=value)
        texts[name] = str(value).lower() if isinstance(value, bool | np.bool_) else str(value)
    return texts


def _check_file(file: Path) -> None:
    try:
        exists = file.exists()
    except (OSError, ValueError) as error:  # too long a name, a null character, a locked folder
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise RobotError(f"cannot be read ({reason})", where=one_line(repr(str(file)), 100)) from None
    if not exists:
        raise RobotError("no such file", where=file)
    if file.is_dir():
        raise RobotError("this is a directory", where=file, expected="a .urdf, .xacro or .xml file")
    if file.suffix.lower() not in SUFFIXES:
        kind = _OTHERS.get(file.suffix.lower())
        what = f"{kind} is not read: give the URDF or xacro file that it was made from" if kind else ""
        raise RobotError(
            what, where=file, expected=f"a name that ends in {listed(SUFFIXES, 'or')}", got=file.name
        )


def expand(
    path: Path, arguments: Mapping[str, str], packages: Packages, call: ElementTree.Element | None = None
) -> tuple[str, dict[str, str], tuple[str, ...]]:
    """The expanded text of a xacro file, after which a macro of its own may be called; its declared arguments
    with the values used, and xacro's warnings; `RobotError` with the file and the cause."""
    import xacro  # 10 ms, and a URDF needs none of it
    import xacro.substitution_args

    table, budget = _Arguments(arguments), Budget()
    printed = _Printed(budget)
    with _LOCK, _patched(xacro, packages, budget, call), redirect_stderr(printed):
        try:
            xml = budget.took(xacro.process_file(str(path), mappings=table).toxml())
        # Expressions in the file may raise anything, and so may xacro on what they return.
        except Exception as error:
            raise _explained(error, path, xacro) from None
        finally:
            xacro.substitution_args_context["arg"] = {}
            xacro.init_stacks(None)
    warnings = [line for line in printed.getvalue().splitlines() if line.startswith("warning: ")]
    return str(xml), {name: table[name] for name in table.declared}, tuple(dict.fromkeys(warnings))


class _Printed(io.StringIO):
    """What a file has xacro print, as far as its budget goes."""

    def __init__(self, budget: Budget) -> None:
        super().__init__()
        self._budget = budget

    def write(self, text: str) -> int:
        return super().write(self._budget.took(text))


class _Arguments(dict[str, str]):
    """xacro's table of arguments, which remembers those that the file asks for while xacro expands it."""

    def __init__(self, arguments: Mapping[str, str]) -> None:
        super().__init__(arguments)
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
def _patched(
    xacro: Any, packages: Packages, budget: Budget, call: ElementTree.Element | None
) -> Iterator[None]:
    """xacro with our reading of files and packages, a call at the file's end, bounds, fewer messages."""

    def find(package: str) -> str:
        folder = packages.find(package, Path(xacro.filestack[-1] if xacro.filestack else packages.file))
        if folder is None:
            lost = packages.missing(package, f"$(find {package})")
            raise refusal(packages.file, replace(lost, where=_inner(packages.file, xacro)))
        return str(folder)

    patches = [
        *replacements(xacro, budget, packages, find),
        (xacro, "parse", _reader(xacro, packages, budget, call)),
        (xacro, "all_includes", []),
        (xacro, "verbosity", 0),
    ]
    saved = [(owner, name, vars(owner).get(name)) for owner, name, _ in patches]
    for owner, name, value in patches:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in saved:
            delattr(owner, name) if value is None else setattr(owner, name, value)


def _reader(
    xacro: Any, packages: Packages, budget: Budget, call: ElementTree.Element | None
) -> Callable[..., Any]:
    """`xacro.parse`, which reads UTF-8 in any locale and refuses a DOCTYPE before anything is expanded."""
    original, main = xacro.parse, packages.file

    def read(text: Any, filename: str | None = None) -> Any:
        if text is not None or filename is None:
            return original(text, filename)
        if Path(filename) != main:
            try:
                check_readable(filename, packages)
            except RefusedContent:
                xacro.filestack.pop()  # as above: the error is the including file's
                raise
        try:
            budget.step(STEPS_OF_A_FILE)
            content = budget.took(read_text(Path(filename)))
            parse(content)
        except FileNotFoundError as error:
            xacro.filestack.pop()  # as xacro does: the error is the including file's
            raise xacro.XacroException(
                f"included file {filename} does not exist", exc=_Missing(error)
            ) from None
        except RobotError as error:
            findings = error.findings
        except XmlError as error:
            findings = (error.finding,)
        else:
            document = original(content)
            if call is not None and Path(filename) == main:
                made = document.createElement(call.tag)
                for name, value in call.items():
                    made.setAttribute(name, value)
                document.documentElement.appendChild(made)
                if not document.documentElement.getAttribute("name"):
                    document.documentElement.setAttribute("name", main.stem)
            return document
        if Path(filename) != main:
            findings = tuple(
                replace(finding, where={"file": filename, **finding.where}) for finding in findings
            )
        raise refusal(main, *findings)

    return read


class _Missing(OSError):
    """A missing file; as an OSError, so that xacro can leave out an optional include."""

    def __str__(self) -> str:
        return ""


def _inner(path: Path, xacro: Any) -> dict[str, str]:
    """The included file that xacro was reading, unless it is the user's own."""
    inner = xacro.filestack[-1] if xacro.filestack else None
    return {} if inner is None or Path(inner) == path else {"file": str(inner)}


def _place(text: str, path: Path, xacro: Any) -> dict[str, Any]:
    """The first line of the file that xacro was reading that has the text, as the file would write it."""
    where: dict[str, Any] = {**_inner(path, xacro)}
    written = (text, escape(text), escape(text, {'"': "&quot;", "'": "&apos;"}))
    lines = read_text(Path(where.get("file", path))).splitlines() if text else []
    line = next((i for i, one in enumerate(lines, 1) if any(form in one for form in written)), None)
    return where if line is None else {**where, "line": line}


def _explained(error: BaseException, path: Path, xacro: Any) -> RobotError:
    """The innermost cause in one line; xacro wraps it once for each expression around it."""
    while isinstance(getattr(error, "exc", None), xacro.XacroException | RobotError | RefusedContent):
        error = error.exc  # type: ignore[attr-defined]  # XacroException has it, as just asked
    if isinstance(error, RobotError):
        return error
    if isinstance(error, RefusedContent):
        return refusal(path, replace(error.finding, where=_place(error.text, path, xacro)))
    inside = getattr(error, "exc", None)
    code, values = "xacro_failed", {"reason": one_line(str(error)) or type(error).__name__}
    if isinstance(inside, xacro.substitution_args.ArgException):
        code, values = "xacro_argument_missing", {"name": str(inside)}
    elif isinstance(error, RecursionError) or isinstance(inside, RecursionError):
        code, values = "xacro_endless", {}
    elif inside is not None and str(error).startswith("<class "):
        values = {"reason": one_line(str(inside))}  # what a $(...) raised, which xacro repeats, and its type
    return refusal(path, Finding(code, values, _inner(path, xacro)))
