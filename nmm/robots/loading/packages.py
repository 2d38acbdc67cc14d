"""Where ROS packages and mesh files are: the folders that `$(find pkg)` and `package://` speak of."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

from nmm.errors import RobotError


class Packages:
    """Finds packages and meshes for one description file, and remembers what it was asked for.

    Searched in this order: the caller's folders, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, the share folder of
    example-robot-data, and the folders above the file. Each may be a package or hold packages.

    Parameters
    ----------
    file : the description file; relative mesh names start in its folder
    folders : the caller's folders

    Attributes
    ----------
    found : the folder of each package that was asked for, or None
    searched : the folders in which packages are looked for

    Raises
    ------
    RobotError : one of the caller's folders does not exist
    """

    def __init__(self, file: Path, folders: Sequence[str | Path] = ()) -> None:
        # os.path answers where pathlib raises: an unknown home, a name too long for the file system.
        given = [Path(os.path.expanduser(folder)).absolute() for folder in folders]
        for folder in given:
            if not os.path.isdir(folder):
                raise RobotError(f"package_dirs: expected a folder, {folder} is none")
        self.file = file.absolute()
        self.folders = (*given, *_environment_folders(), *_share_folders())
        self.searched = (*self.folders, *self.file.parents)
        self.found: dict[str, Path | None] = {}
        self._folders: dict[str, list[Path]] = {}

    def find(self, package: str) -> Path | None:
        """The folder of a package, or None."""
        return next(iter(self._candidates(package)), None)

    def mesh(self, name: str) -> Path | str:
        """The absolute path of a mesh file, or a sentence that says why there is none.

        Parameters
        ----------
        name : as in the file: package://, model://, file://, absolute, or relative to the file's folder
        """
        scheme, separator, rest = name.partition("://")
        if not separator:
            return self._plain(name)
        if scheme in ("package", "model"):
            # Some files have three slashes.
            package, _, inside = rest.lstrip("/").partition("/")
            folders = self._candidates(package)
            if not folders:
                return f"package {package!r} not found (give its folder in package_dirs, --package-dir)"
            return _first_file(folder / inside for folder in folders) or "no such file in the package"
        if scheme == "file":
            return _first_file((Path(rest), Path(unquote(rest)))) or "no such file"
        return f"cannot read from {scheme}://"

    def _plain(self, name: str) -> Path | str:
        # Not the folders above the file: a bare name should not find a file far away by chance.
        folders = (self.file.parent, *self.folders)
        return _first_file(folder / name for folder in folders) or "no such file"

    def _candidates(self, package: str) -> list[Path]:
        """The folders of that name, looked for once: a robot may have a hundred meshes in one package."""
        folders = self._folders.get(package)
        if folders is None:
            folders = self._folders[package] = []
            if package not in ("", ".", "..") and "/" not in package:
                for folder in self.searched:
                    if folder.name == package:
                        folders.append(folder)
                    if os.path.isdir(folder / package):
                        folders.append(folder / package)
        self.found[package] = folders[0] if folders else None
        return folders


def _first_file(paths: Iterable[Path]) -> Path | None:
    return next((path.absolute() for path in paths if os.path.isfile(path)), None)


def _environment_folders() -> list[Path]:
    def split(variable: str) -> list[Path]:
        return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]

    return split("ROS_PACKAGE_PATH") + [prefix / "share" for prefix in split("AMENT_PREFIX_PATH")]


def package_file(name: str, folders: Sequence[str | Path] = ()) -> Path:
    """The file that a name package://PACKAGE/PATH stands for.

    Parameters
    ----------
    name : the name
    folders : the caller's folders

    Raises
    ------
    RobotError : no such package or file; lists the folders that were searched
    """
    packages = Packages(Path(os.sep), folders)  # there is no file yet beside which to search
    found = packages.mesh(name)
    if isinstance(found, str):
        searched = ", ".join(map(str, packages.searched)) or "none"
        raise RobotError(f"{name}: {found}; searched: {searched}")
    return found


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
