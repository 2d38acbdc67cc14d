"""The surfaces in a mesh file, read in Python: whatever a damaged file holds ends in an error, and not, as in
Coal's reader, with the process. That one also joins faces of a file's second part to corners of its first."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.files import read_bytes
from nmm.base.text_format import one_line

if TYPE_CHECKING:
    import trimesh

#: No mesh of a robot has more bytes, is farther from its origin (in its units), or has more nodes, each
#: counted where another stands for it.
LONGEST, FARTHEST, MOST_NODES = 500_000_000, 1e9, 10_000
_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
#: What says how a COLLADA file's surfaces look. One that is broken takes the surface with it.
_LOOKS = {
    "bind_material", "instance_camera", "instance_light", "library_cameras", "library_effects",
    "library_images", "library_lights", "library_materials",
}  # fmt: skip

#: What trimesh tells about a file is for those who ask for it, not for standard error.
_SILENT = logging.NullHandler()


def mesh_arrays(file: str, scale: Sequence[float] | Array = (1.0, 1.0, 1.0)) -> tuple[Array, Integers]:
    """Vertices (V, 3), stretched by `scale`, and faces (F, 3), of all that is in a file; `OSError` or
    `ValueError` says why there are none."""
    content = read_bytes(Path(file), LONGEST)
    corners = _binary_stl(content) if file.lower().endswith(".stl") else None
    if corners is None:
        parts = [(mesh.vertices, mesh.faces) for mesh in _meshes(file, content, looks=False)]
    else:
        parts = [(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))]
    before = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.vstack([np.asarray(block, dtype=float) for block, _ in parts]) * scale
    faces = np.vstack([block + start for (_, block), start in zip(parts, before, strict=False)])
    if not np.all(np.abs(vertices) <= FARTHEST):
        raise ValueError(f"a corner is no point within {FARTHEST:g} m")
    return vertices, np.asarray(faces, dtype=np.int64)


def meshes_of(file: str) -> list[trimesh.Trimesh]:
    """The surfaces of a file, one for each material, as it says that they look; errors as `mesh_arrays`."""
    return _meshes(file, read_bytes(Path(file), LONGEST), looks=True)


def _binary_stl(content: bytes) -> Array | None:
    """The corners (F, 3, 3) of an STL file that is as long as its header says: importing trimesh takes more
    time than reading a robot's."""
    count = int.from_bytes(content[80:84], "little")
    if not count or len(content) != 84 + count * _STL.itemsize:
        return None
    return np.asarray(np.frombuffer(content, _STL, offset=84)["corners"], dtype=float)


def _meshes(file: str, content: bytes, looks: bool) -> list[trimesh.Trimesh]:
    kind = Path(file).suffix.lower()[1:]
    logging.getLogger("trimesh").addHandler(_SILENT)
    try:
        import trimesh  # half a second

        options: dict[str, object] = {}
        if kind == "dae":
            content = _collada(content, looks)
            options["ignore_broken"] = looks
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            loaded = trimesh.load_scene(
                io.BytesIO(content), file_type=kind, resolver=_Beside(file), process=False, **options
            )
            meshes = [mesh for mesh in loaded.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
            right = all(map(_is_sound, meshes))
    except Exception as error:  # trimesh's readers raise whatever they meet
        raise ValueError(
            f"damaged, or no {kind.upper()} ({type(error).__name__}: {one_line(str(error))})"
        ) from None
    if not meshes or not right:
        raise ValueError("holds faces without corners" if meshes else "holds no surface")
    return meshes


def _is_sound(mesh: trimesh.Trimesh) -> bool:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    finite = bool(np.all(np.abs(vertices) <= FARTHEST))
    return finite and int(faces.min()) >= 0 and int(faces.max()) < len(vertices)


class _Beside:
    """What a mesh file may name: files in its folder, read as far as is reasonable."""

    def __init__(self, file: str) -> None:
        self._folder = Path(file).parent

    def get(self, name: str) -> bytes:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise OSError("not in the folder of the mesh")
        return read_bytes(self._folder / name, LONGEST)

    __getitem__ = get


def _collada(content: bytes, looks: bool) -> bytes:
    """The text of a COLLADA file, without how it looks if nobody asks; `ValueError` where nodes that stand
    for others multiply."""
    root = ElementTree.fromstring(content)
    tags = {element: element.tag.rpartition("}")[2] for element in root.iter()}
    nodes = {node.get("id"): node for node, tag in tags.items() if tag == "node"}
    left = MOST_NODES

    def visit(node: ElementTree.Element) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise ValueError(f"more than {MOST_NODES} nodes")
        for part in node:
            if tags[part] == "node":
                visit(part)
            elif tags[part] == "instance_node":
                visit(nodes[part.get("url", "")[1:]])

    for scene in [element for element, tag in tags.items() if tag == "visual_scene"]:
        visit(scene)
    if looks:
        return content
    for element in tags:
        element[:] = [part for part in element if tags[part] not in _LOOKS]
    return ElementTree.tostring(root)
