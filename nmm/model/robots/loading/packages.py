"""Where ROS packages and mesh files are: the folders that `$(find pkg)` and `package://` speak of."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

from nmm.base.errors import RobotError
from nmm.base.files import named_folder
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.robots.loading.xml_tree import read_text

PACKAGE = "package://"
#: So many folders, from the file's own upwards, are searched for what lies nowhere else.
_NEAR = 5


class Packages:
    """Finds packages and meshes for one description file; `found` records what was asked for, `nearby` what
    is in none of the places where it should be, but has its name above the file.

    Searched in order: the caller's folders (`RobotError` for one that does not exist), ROS_PACKAGE_PATH,
    AMENT_PREFIX_PATH, example-robot-data's share folder, the folders above the file; each may be or hold
    packages, and the caller's may be NAME=FOLDER. Relative mesh names start in the file's folder."""

    def __init__(self, file: Path, folders: Sequence[str | Path] = ()) -> None:
        # os.path answers where pathlib raises: an unknown home, a name too long for the file system.
        named = [named_folder(str(folder)) for folder in folders]
        absolute = [(name, Path(os.path.expanduser(folder)).absolute()) for name, folder in named]
        for _, folder in absolute:
            if not os.path.isdir(folder):
                raise RobotError(f"{folder} is no folder", where="package_dirs", got=str(folder))
        self.file = file.absolute()
        unnamed = [folder for name, folder in absolute if not name]
        self.folders = (*unnamed, *_environment_folders(), *_share_folders())
        #: Where MuJoCo looks for meshes, as the file says it.
        self.mesh_folder: str | None = None
        self.nearby: dict[str, Path] = {}
        self.searched = (*self.folders, *self.file.parents)
        self.found: dict[str, Path | None] = {}
        self._folders = {name: [folder] for name, folder in absolute if name}
        self._named = {folder for name, folder in absolute if name}
        self.found.update((name, folder) for name, folder in absolute if name)

    def find(self, package: str, asking: Path | None = None) -> Path | None:
        """The folder of a package, or the nearest above the file that asks, with what that names in it."""
        match = next(iter(self._candidates(package)), None)
        if match is None and asking is not None:
            named = re.findall(rf"\$\(find\s+{re.escape(package)}\)/([^\s\"'<>$]+)", read_text(asking))
            # A bare name is asked for nearby only: five folders up, a stranger's file may have it.
            match = next(
                (
                    folder
                    for up, folder in enumerate(asking.absolute().parents[:_NEAR])
                    for tail in named
                    if (up < 2 or "/" in tail) and os.path.isfile(folder / tail)
                ),
                None,
            )
            if match is not None:
                self.nearby[package] = self.found[package] = match
                self._folders[package] = [match]
        return match

    def is_named(self, folder: Path) -> bool:
        """Whether the caller or the environment names the folder, or one that holds it."""
        return folder in self._named or any(folder.is_relative_to(one) for one in self.folders)

    def mesh(self, name: str) -> Path | Finding:
        """The file of a package://, model://, file://, absolute or relative mesh name; or "mesh_missing"."""
        scheme, separator, rest = name.partition("://")
        paths: Iterable[Path] = ()
        missing = {"cause": "file"}
        if not separator:
            # Not the folders above the file: a bare name should not find a file far away by chance.
            paths = (folder / name for folder in (self.file.parent, *self.folders))
        elif scheme in ("package", "model"):
            # Some files have three slashes.
            package, _, inside = rest.lstrip("/").partition("/")
            folders = self._candidates(package)
            paths = (folder / inside for folder in folders)
            missing = {"cause": "file_in_package" if folders else "package", "package": package}
        elif scheme == "file":
            paths = (Path(rest), Path(unquote(rest)))
        else:
            missing = {"cause": "scheme", "scheme": scheme}
        file = next((path.absolute() for path in paths if os.path.isfile(path)), None)
        if file is None and missing["cause"] != "scheme":
            file = self._of_mujoco(name) or self._nearby(name, rest if separator else name)
        return file or Finding("mesh_missing", {"mesh": name, **missing})

    def _of_mujoco(self, name: str) -> Path | None:
        """The file where MuJoCo would find it, by its whole relative name or, as usual, by its last part."""
        if self.mesh_folder is None:
            return None
        folder = self.file.parent / self.mesh_folder
        parts = [name] * ("://" not in name) + [name.rpartition("/")[2]]
        return next((folder / part for part in parts if os.path.isfile(folder / part)), None)

    def _nearby(self, name: str, path: str) -> Path | None:
        """The longest end of a path, of a folder and a file at least, that lies above the description; of a
        bare name, the file beside it."""
        parts = [part for part in path.split("/") if part not in ("", ".", "..")]
        ends = [parts[start:] for start in range(max(1, len(parts) - 1))]
        above = self.file.parents[: _NEAR if len(parts) > 1 else 1]
        paths = (folder.joinpath(*end) for end in ends for folder in above)
        file = next((path for path in paths if os.path.isfile(path)), None)
        if file is not None:
            self.nearby[name] = file
        return file

    @property
    def notes(self) -> list[Finding]:
        """What was found nearby only."""
        first = next(iter(self.nearby.items()), None)
        if first is None:
            return []
        values = {"count": len(self.nearby), "name": first[0], "place": str(first[1])}
        return [Finding("found_nearby", values)]

    def missing(self, package: str, by: str) -> Finding:
        searched = [*dict.fromkeys(map(str, self.searched))]
        return Finding("package_missing", {"package": package, "by": by, "searched": searched})

    def _candidates(self, package: str) -> list[Path]:
        """The folders of that name, looked for once: a robot may have a hundred meshes in one package."""
        if package not in self._folders:
            searched = () if package in ("", ".", "..") or "/" in package else self.searched
            places = (path for folder in searched for path in (folder, folder / package))
            named = (path for path in places if path.name == package)
            folders = [path for path in named if path in searched or os.path.isdir(path)]
            self._folders[package] = folders
            self.found[package] = folders[0] if folders else None
        return self._folders[package]


def _environment_folders() -> list[Path]:
    def split(variable: str) -> list[Path]:
        return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]

    return split("ROS_PACKAGE_PATH") + [prefix / "share" for prefix in split("AMENT_PREFIX_PATH")]


def package_file(name: str, folders: Sequence[str | Path] = ()) -> Path:
    """The file of a name package://PACKAGE/PATH; `RobotError` lists the folders searched, yours first."""
    packages = Packages(Path(os.sep), folders)  # there is no file yet beside which to search
    answer = packages.mesh(name)
    if isinstance(answer, Path):
        return answer
    if answer.values["cause"] == "package":
        answer = packages.missing(answer.values["package"], PACKAGE)
    raise refusal(name, answer)


@cache
def _share_folders() -> tuple[Path, ...]:
    """Where example-robot-data lives: beside Pinocchio in its wheels' common prefix, or in conda's."""
    prefixes = [Path(sys.prefix)]
    pinocchio = find_spec("pinocchio")
    if pinocchio is not None and pinocchio.origin is not None:
        prefixes[:0] = [path for path in Path(pinocchio.origin).parents if path.name == "cmeel.prefix"]
    return tuple(
        prefix / "share" for prefix in prefixes if (prefix / "share" / "example-robot-data").is_dir()
    )
