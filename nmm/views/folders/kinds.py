"""Which kind of folder one is: those of nmm by their formats, and those of plugins."""

from pathlib import Path
from pkgutil import resolve_name

from nmm.base.plugins import additions, complain

#: What recognises a folder's format, "package.module:name", by what the folder is called.
FOLDERS = {
    "run": "nmm.views.folders.run:is_run",
    "comparison": "nmm.views.folders.comparison:is_comparison",
    "laps": "nmm.views.folders.laps:is_laps",
    "map": "nmm.views.folders.map:is_map",
    "torques": "nmm.views.folders.torques:is_torques",
}


def folder_kind(folder: Path) -> str:
    """What a folder is called by its format: "run", "map", "sweep"; "" for another one."""
    for kind, entry in FOLDERS.items():
        if resolve_name(entry)(folder):
            return kind
    for kind, addition in additions("folders", FOLDERS).items():
        if (recognised := addition.load()) is not None:
            try:
                if recognised(folder):
                    return kind
            except Exception as error:  # whatever a stranger's function does
                complain(addition.plugin, f"folder {kind}: {type(error).__name__}: {error}")
    return ""
