"""An MJCF file as one tree of bodies: includes, default classes, frames, replicas and attached models."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import pinocchio as pin

from nmm.model.robots.loading.budget import MOST_LINKS
from nmm.model.robots.loading.mjcf_elements import ElementReader
from nmm.model.robots.loading.mjcf_files import include, inside, parsed
from nmm.model.robots.loading.mjcf_numbers import ORIGIN, ROTATIONS, Numbers, at
from nmm.model.robots.loading.mjcf_tree import MjcfBody, Part, moved, names_in, renamed
from nmm.model.robots.loading.xml_tree import Attributes, Element, children

#: What is asked of <compiler>: what stands without it, and what is understood.
_SETTINGS = {
    "angle": ("degree", "degree|radian"),
    "eulerseq": ("xyz", "[xyzXYZ]{3}"),
    "autolimits": ("true", "true|false"),
    "coordinate": ("local", "local"),
}
#: What a body may hold, of which nothing is taken: pictures, and what is no rigid body.
_LEFT_OUT = ("camera", "light", "plugin", "flexcomp")
#: What scales a <frame> and all in it.
_SCALES = ("scale", "scaling", "massscale")
#: Sections whose elements speak of bodies and joints, and the attributes that name them.
_SECTIONS = ("equality", "actuator", "contact")
_NAMES = {
    **dict.fromkeys(("joint", "joint1", "joint2", "jointinparent"), "joint"),
    **dict.fromkeys(("body", "body1", "body2"), "body"),
    **dict.fromkeys(("site", "site1", "site2", "refsite", "cranksite", "slidersite"), "site"),
    **dict.fromkeys(("geom", "geom1", "geom2"), "geom"),
}
#: Actuators of all kinds share a class's defaults for these.
_OF_ACTUATORS = ("ctrlrange", "ctrllimited", "forcerange", "forcelimited", "gear")
_ACTUATORS = (
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "pid",
)

#: By tag, the attributes that a class gives.
_Class = dict[str, dict[str, str]]


class Dropped(NamedTuple):
    """Something of the file that is left out, and where it is said."""

    name: str
    element: Element


@dataclass
class Mjcf:
    """world : the bodies, and what else is in the world
    references : elements of <equality>, <actuator> and <contact>, their classes' values written out
    keys : the keyframes; settings : <compiler>; left_out : what of the file is not in here"""

    name: str
    settings: dict[str, str]
    world: MjcfBody
    references: list[Element] = field(default_factory=list)
    keys: list[Element] = field(default_factory=list)
    left_out: list[Dropped] = field(default_factory=list)


def read_mjcf(root: Element, file: Path, faults: Attributes) -> Mjcf:
    """What the file of that <mujoco> holds; `RobotError` for files that it includes and that are none."""
    include(root, file)
    model = _Model(root, file, PurePosixPath(), faults)
    world = Element("body")
    world.extend(part for section in children(root, "worldbody") for part in section)
    parts = [*model.contents(world, "main")]
    keys = [key for section in children(root, "keyframe") for key in inside(section)]
    name = root.get("model") or file.stem
    body = MjcfBody(world, "world", pin.SE3.Identity(), parts)
    return Mjcf(name, model.settings, body, model.references, keys, model.left_out)


class _Model:
    """One <mujoco> element, with its own units, classes and assets."""

    def __init__(self, root: Element, file: Path, folder: PurePosixPath, faults: Attributes) -> None:
        self._root, self._file, self._folder, self._faults = root, file, folder, faults
        self.left_out: list[Dropped] = []
        self.settings = {key: usual for key, (usual, _) in _SETTINGS.items()}
        for compiler in children(root, "compiler"):
            self.settings |= compiler.attrib
        for key, (usual, pattern) in _SETTINGS.items():
            if not re.fullmatch(pattern, self.settings[key]):
                element = next(
                    (compiler for compiler in children(root, "compiler") if compiler.get(key)), None
                )
                faults.add(element, "mjcf_unread", what=f"<compiler {key}={self.settings[key]!r}>")
                self.settings[key] = usual
        self._numbers = Numbers(self.settings, faults)
        self._classes: dict[str, _Class] = {"main": {}}
        for default in children(root, "default"):
            self._read_class(default, "main", {})
            self._classes[default.get("class", "main")] = self._classes["main"]
        assets = [part for section in children(root, "asset") for part in inside(section)]
        meshes = [self._with_defaults(asset, "main") for asset in assets if asset.tag == "mesh"]
        self._elements = ElementReader(
            self._numbers,
            self.settings,
            {mesh.get("name", _stem(mesh)): mesh for mesh in meshes},
            {
                material.get("name", ""): material.get("rgba")
                for material in assets
                if material.tag == "material"
            },
            folder,
        )
        self._models = {model.get("name", _stem(model)): model for model in assets if model.tag == "model"}
        self.references = [
            self._with_defaults(element, "main", section)
            for section in _SECTIONS
            for parent in children(root, section)
            for element in inside(parent)
        ]

    def _read_class(self, element: Element, name: str, above: _Class) -> None:
        """A <default>: what the one around it says, and what the elements in it change."""
        made = {tag: {**values} for tag, values in self._classes.get(name, above).items()}
        for part in inside(element):
            if part.tag == "default":
                continue
            _override(made.setdefault(part.tag, {}), part.attrib)
            if part.tag in _ACTUATORS:
                shared = {key: value for key, value in part.attrib.items() if key in _OF_ACTUATORS}
                made.setdefault("actuator", {}).update(shared)
        self._classes[name] = made
        for nested in children(element, "default"):
            self._read_class(nested, nested.get("class", name), made)

    def _with_defaults(self, element: Element, childclass: str, section: str = "") -> Element:
        """The element with what its class gives; the class's own tag is the section's in <equality> and
        <actuator>."""
        name = element.get("class", childclass)
        self._faults.choice(element, name, [*self._classes], "default class", {})
        defaults = self._classes.get(name, {})
        values = {**defaults.get(section or element.tag, {})}
        _override(values, element.attrib)
        made = Element(element.tag, {key: value.strip() for key, value in values.items()})
        made.extend(element)
        made.line, made.file = element.line, element.file
        return made

    def contents(self, parent: Element, childclass: str) -> Iterator[Part]:
        """What a body, a frame or a replica holds, in the axes of that."""
        childclass = parent.get("childclass", childclass)
        for element in inside(parent):
            match element.tag:
                case "frame":
                    yield from self._frame(element, childclass)
                case "replicate":
                    yield from self._replicate(element, childclass)
                case "attach":
                    yield from self._attach(element)
                case "body":
                    own = [*self.contents(element, childclass)]
                    yield MjcfBody(element, element.get("name", ""), self._numbers.place(element), own)
                case "joint" | "freejoint":
                    yield self._elements.joint(self._with_defaults(element, childclass))
                case "geom":
                    yield self._elements.geom(self._with_defaults(element, childclass))
                case "site":
                    yield self._elements.site(self._with_defaults(element, childclass))
                case "inertial":
                    yield self._elements.inertial(element)
                case tag if tag not in _LEFT_OUT:
                    self._faults.add(element, "mjcf_unread", what=f"<{tag}>")

    def _frame(self, frame: Element, childclass: str) -> Iterator[Part]:
        for key in _SCALES:
            if frame.get(key) is not None:
                self._faults.add(frame, "mjcf_unread", what=f"<frame {key}>")
        place = self._numbers.place(frame)
        yield from (moved(part, place) for part in self.contents(frame, childclass))

    def _replicate(self, element: Element, childclass: str) -> Iterator[Part]:
        """Each replica is moved on in the axes of the one before it, and turned by so often the angles; names
        get its number."""
        count = int(self._numbers.number(element, "count", 1.0))
        parts = [*self.contents(element, childclass)]
        if not 0 <= count * max(len(names_in(parts)), 1) <= MOST_LINKS:
            self._faults.add(element, "beyond_bound", what="links", most=MOST_LINKS)
            return
        offset, angles = (self._numbers.vector(element, key, ORIGIN) for key in ("offset", "euler"))
        digits = len(str(count - 1))
        ends = [f"{element.get('sep', '')}{number:0{digits}d}" for number in range(count)]
        self._follow(names_in(parts), ends)
        place = pin.SE3.Identity()
        for number, end in enumerate(ends):
            place.rotation = self._numbers.turned(number * angles)
            for part in parts:
                yield moved(renamed(part, lambda _, name, end=end: name + end), place)  # type: ignore[misc]  # a default
            place = place * at(offset)

    def _follow(self, names: set[tuple[str, str]], ends: Sequence[str]) -> None:
        """References to replicas alone are repeated for each, as in MuJoCo; mixed ones are left out."""
        made: list[Element] = []
        for element in self.references:
            spoken = {key: (_NAMES[key], name) for key, name in element.attrib.items() if key in _NAMES}
            replicas = {key: name for key, (kind, name) in spoken.items() if (kind, name) in names}
            if not replicas:
                made.append(element)
            elif len(replicas) < len(spoken):
                self.left_out.append(Dropped(f"<{element.tag}> {element.get('name', '')}".strip(), element))
            else:
                made += [
                    _renamed(element, {key: name + end for key, name in replicas.items()}) for end in ends
                ]
        self.references = made

    def _attach(self, element: Element) -> Iterator[Part]:
        """The body, the frame or all of another file's model, its names behind a prefix."""
        name, prefix = element.get("model", ""), element.get("prefix", "")
        self._faults.choice(element, name, [*self._models], "model", {"part": "<attach>"})
        asset = self._models.get(name)
        if asset is None:
            return
        file = self._file.parent / asset.get("file", "")
        inner = parsed(file, asset.get("file", ""), self._file)
        include(inner, file)
        folder = self._folder / PurePosixPath(asset.get("file", "")).parent
        other = _Model(inner, file, folder, self._faults)
        world = Element("body")
        world.extend(part for section in children(inner, "worldbody") for part in section)
        wanted = [(key, value) for key in ("body", "frame") if (value := element.get(key))]
        for key, value in wanted:
            matches = [
                part for part in inside(world, deep=True) if part.tag == key and part.get("name") == value
            ]
            self._faults.choice(element, value, [value] if matches else [], key, {"part": "<attach>"})
            world[:] = matches[:1]
        parts = [renamed(part, lambda _, name: prefix + name) for part in other.contents(world, "main")]
        names = names_in(parts)
        for reference in other.references:
            spoken = {key: prefix + value for key, value in reference.attrib.items() if key in _NAMES}
            if spoken and all((_NAMES[key], value) in names for key, value in spoken.items()):
                self.references.append(_renamed(reference, spoken))
        for frame in (key for section in children(inner, "keyframe") for key in inside(section)):
            self.left_out.append(Dropped(f"keyframe {frame.get('name', '')} of {name}", frame))
        self.left_out += other.left_out
        yield from parts


def _override(values: dict[str, str], attributes: dict[str, str]) -> None:
    """Attributes over those of a class: a rotation replaces one that is said otherwise."""
    if any(key in attributes for key in ROTATIONS):
        for key in ROTATIONS:
            values.pop(key, None)
    values.update(attributes)


def _renamed(element: Element, names: dict[str, str]) -> Element:
    made = Element(element.tag, {**element.attrib, **names})
    made.extend(element)
    made.line, made.file = element.line, element.file
    return made


def _stem(asset: Element) -> str:
    return PurePosixPath(asset.get("file", "")).stem
