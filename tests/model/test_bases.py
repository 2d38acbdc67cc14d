"""The bundled bases and the small arm: measured as their arguments say, whole, solid, on the ground."""

from __future__ import annotations

import io
import itertools
import math
import xml.etree.ElementTree as ET
from functools import cache
from types import MappingProxyType

import numpy as np
import pinocchio as pin
import pytest
import xacro
import yourdfpy
from numpy.typing import NDArray
from places import ROOT
from surfaces import coincident, reach_down, surface
from thinned import thinned

from nmm.model.platforms import Car, DifferentialDrive, Layout, Mecanum, Tractor
from nmm.model.robots.loading.measured_joints import Measured
from nmm.model.robots.loading.measured_layout import measure_layout

pytestmark = pytest.mark.usefixtures("xacro_each_time")

Array = NDArray[np.float64]
ROBOTS = ROOT / "robots"

DEFAULTS = MappingProxyType(
    {
        "differential_base": {"wheel_radius": 0.1, "track": 0.5, "length": 0.8, "deck_height": 0.35},
        "car_base": {
            "wheelbase": 0.7,
            "track": 0.56,
            "wheel_radius": 0.12,
            "max_steering": 0.6,
            "deck_height": 0.42,
        },
        "trailer_base": {
            "wheel_radius": 0.1,
            "track": 0.44,
            "length": 0.7,
            "hitch_offset": 0.25,
            "max_fold": 1.2,
            "deck_height": 0.32,
        },
        "omni_base": {"wheel_radius": 0.1, "length": 0.5, "width": 0.5, "deck_height": 0.35},
        "small_arm": {"upper": 0.24, "fore": 0.2, "tool": 0.16},
    }
)
VARIANTS = MappingProxyType(
    {
        "differential_base": [
            {"wheel_radius": 0.05, "track": 0.3, "length": 0.4, "deck_height": 0.15},
            {"wheel_radius": 0.2, "track": 0.9, "length": 1.6, "deck_height": 0.7},
            {"deck_height": 0.21},
        ],
        "car_base": [
            {"wheelbase": 2.7, "track": 1.6, "wheel_radius": 0.32, "max_steering": 0.7, "deck_height": 1.1},
            {"wheelbase": 0.5, "track": 0.4, "wheel_radius": 0.1, "max_steering": 0.3, "deck_height": 0.3},
        ],
        "trailer_base": [
            {"hitch_offset": 0.0, "max_fold": 1.0},
            {"length": 1.4, "hitch_offset": 0.4, "track": 0.8, "wheel_radius": 0.18, "deck_height": 0.6},
        ],
        "omni_base": [
            {"wheel_radius": 0.06, "length": 0.3, "width": 0.25, "deck_height": 0.2},
            {"wheel_radius": 0.15, "length": 1.0, "width": 0.8, "deck_height": 0.5},
        ],
        "small_arm": [{"upper": 0.1, "fore": 0.1, "tool": 0.1}, {"upper": 0.6, "fore": 0.5, "tool": 0.3}],
    }
)
CASES = [(name, i) for name in DEFAULTS for i in range(1 + len(VARIANTS[name]))]
BASES = [name for name in DEFAULTS if name.endswith("_base")]
ON_WHEELS = [case for case in CASES if case[0] in BASES]
each_case = pytest.mark.parametrize(("name", "variant"), thinned(CASES, lambda case: case[1] < 2))
each_base = pytest.mark.parametrize(("name", "variant"), thinned(ON_WHEELS, lambda case: case[1] < 2))
each_robot = pytest.mark.parametrize("name", list(DEFAULTS))


def given(name: str, variant: int) -> dict[str, float]:
    return {**DEFAULTS[name], **(VARIANTS[name][variant - 1] if variant else {})}


@cache
def expand(name: str, variant: int = 0) -> str:
    """The robot's URDF text: with its defaults, or with a variant's arguments."""
    changed = VARIANTS[name][variant - 1] if variant else {}
    mappings = {key: str(value) for key, value in changed.items()}
    text: str = xacro.process_file(str(ROBOTS / f"{name}.urdf.xacro"), mappings=mappings).toxml()
    return text


@cache
def model_of(name: str, variant: int = 0) -> pin.Model:
    return pin.buildModelFromXML(expand(name, variant))


def find(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    assert found is not None, path
    return found


def at(model: pin.Model, angles: dict[str, float]) -> Array:
    q = pin.neutral(model)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            angle if joint.nq == 1 else (math.cos(angle), math.sin(angle))
        )
    return q


def random_angles(model: pin.Model, rng: np.random.Generator) -> dict[str, float]:
    angles = {}
    for i in range(1, model.njoints):
        lower, upper = -np.pi, np.pi
        if model.joints[i].nq == 1:
            index = model.joints[i].idx_q
            lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
        angles[str(model.names[i])] = float(rng.uniform(lower, upper))
    return angles


# ------------------------------------------------------------------------------------------ description


@each_robot
def test_defaults_are_declared(name: str) -> None:
    arguments = {
        argument.attrib["name"]: float(argument.attrib["default"])
        for argument in ET.parse(ROBOTS / f"{name}.urdf.xacro").iter("{http://www.ros.org/wiki/xacro}arg")
    }
    assert arguments == DEFAULTS[name]


@pytest.mark.parametrize(
    ("name", "platform"),
    [
        ("differential_base", "differential"),
        ("car_base", "car"),
        ("trailer_base", "tractor"),
        ("omni_base", "mecanum"),
        ("small_arm", None),
    ],
)
def test_a_base_declares_its_platform(name: str, platform: str | None) -> None:
    declared = [element.attrib.get("platform") for element in ET.fromstring(expand(name)).findall("nmm")]
    assert declared == ([] if platform is None else [platform])


@each_case
def test_forward_kinematics_is_yourdfpys(name: str, variant: int) -> None:
    model, rng = model_of(name, variant), np.random.default_rng(5)
    twin = yourdfpy.URDF.load(io.BytesIO(expand(name, variant).encode()), load_meshes=False)
    data = model.createData()
    for _ in range(10):
        angles = random_angles(model, rng)
        pin.framesForwardKinematics(model, data, at(model, angles))
        twin.update_cfg(angles)
        for link in twin.link_map:
            expected = data.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(twin.get_transform(link), expected, atol=1e-12)


@each_base
def test_the_layout_is_what_the_arguments_say(name: str, variant: int) -> None:
    g, layout = given(name, variant), layout_of(name, variant)
    if name == "differential_base":
        platform = DifferentialDrive.fit(layout)
        assert [platform.radius, platform.track] == pytest.approx([g["wheel_radius"], g["track"]])
    elif name == "car_base":
        car = Car.fit(layout)
        assert [car.wheelbase, car.max_steering] == pytest.approx([g["wheelbase"], g["max_steering"]])
        assert car.coordinates == ("x", "y", "theta", "steering")
    elif name == "trailer_base":
        tractor = Tractor.fit(layout)
        assert [t.joint for t in tractor.trailers] == ["hitch1", "hitch2"]
        for trailer in tractor.trailers:
            found = [trailer.length, trailer.hitch, trailer.max_angle]
            assert found == pytest.approx([g["length"], g["hitch_offset"], g["max_fold"]])
    else:
        mecanum = Mecanum.fit(layout)
        found = [mecanum.radius, mecanum.length, mecanum.width]
        assert found == pytest.approx([g["wheel_radius"], g["length"], g["width"]])


def layout_of(name: str, variant: int) -> Layout:
    return measure_layout(Measured(model_of(name, variant), (), name), None)


@each_base
def test_an_arm_stands_on_the_deck(name: str, variant: int) -> None:
    """Its mount is upright, x forward, at the height deck_height, and nothing of the body is above it."""
    model = model_of(name, variant)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    mounts = [frame.name for frame in model.frames if frame.name.endswith("_mount")]
    assert "arm_mount" in mounts
    assert len(mounts) == (3 if name == "trailer_base" else 1)
    drawing = Drawing(name, variant)
    for mount in mounts:
        placement = data.oMf[model.getFrameId(mount)]
        np.testing.assert_allclose(placement.rotation, np.eye(3), atol=1e-12)
        height = given(name, variant)["deck_height"]
        assert placement.translation[2] == pytest.approx(height)
        for place in drawing.place({}):
            near = np.linalg.norm((place.translation - placement.translation)[:2]) < 0.05
            assert not near or place.translation[2] <= height


def test_the_small_arm_reaches_its_length() -> None:
    """Closed form: the shoulder is 0.12 m up; stretched forward, `ee` is all three lengths ahead of it."""
    for variant in range(1 + len(VARIANTS["small_arm"])):
        g, model = given("small_arm", variant), model_of("small_arm", variant)
        data, frame = model.createData(), model.getFrameId("ee")
        angles = {"q1": 0.7, "q2": 0.9, "q3": 0.4, "q4": -0.2, "q5": 1.1}
        pin.framesForwardKinematics(model, data, at(model, angles))
        tilts = np.cumsum([0.9, 0.4, -0.2])
        lengths = np.array([g["upper"], g["fore"], g["tool"]])
        reach, height = lengths @ np.sin(tilts), 0.12 + lengths @ np.cos(tilts)
        expected = [reach * math.cos(0.7), reach * math.sin(0.7), height]
        np.testing.assert_allclose(data.oMf[frame].translation, expected, atol=1e-12)
        tool = [math.sin(tilts[2]) * math.cos(0.7), math.sin(tilts[2]) * math.sin(0.7), math.cos(tilts[2])]
        np.testing.assert_allclose(data.oMf[frame].rotation[:, 0], tool, atol=1e-12)


BAD = [
    ("differential_base", {"wheel_radius": "0"}, "wheel_radius must be greater than 0"),
    ("differential_base", {"track": "nan"}, "track must be a finite number"),
    ("differential_base", {"length": "0.45"}, "length must be greater than 0.5 (m)"),
    ("differential_base", {"deck_height": "0.2"}, "deck_height must be greater than 0.2 (m)"),
    ("car_base", {"wheel_radius": "-1"}, "wheel_radius must be greater than 0"),
    ("car_base", {"wheelbase": "0.3"}, "wheelbase must be greater than 0.36 (m)"),
    ("car_base", {"track": "wide"}, "track must be a finite number"),
    ("car_base", {"track": "0.3"}, "track must be greater than 0.36 (m)"),
    ("car_base", {"max_steering": "1.5707963"}, "max_steering must be between 0 and 1.19"),
    ("car_base", {"max_steering": "0"}, "max_steering must be between 0 and"),
    ("car_base", {"max_steering": "inf"}, "max_steering must be between 0 and"),
    ("car_base", {"deck_height": "0.3"}, "deck_height must be greater than 0.3 (m)"),
    ("trailer_base", {"wheel_radius": "0.0"}, "wheel_radius must be greater than 0"),
    ("trailer_base", {"length": "0.4"}, "length must be greater than 0.4 (m)"),
    ("trailer_base", {"hitch_offset": "-0.1"}, "hitch_offset must be at least 0 (m)"),
    ("trailer_base", {"hitch_offset": "x"}, "hitch_offset must be a finite number"),
    ("trailer_base", {"max_fold": "3.2"}, "max_fold must be between 0 and 3.14"),
    ("trailer_base", {"deck_height": "0.1"}, "deck_height must be greater than 0.2 (m)"),
    ("omni_base", {"wheel_radius": "0"}, "wheel_radius must be greater than 0"),
    ("omni_base", {"length": "0.26"}, "length must be greater than 0.26 (m)"),
    ("omni_base", {"width": "0"}, "width must be greater than 0.2 (m)"),
    ("omni_base", {"deck_height": "0.24"}, "deck_height must be greater than 0.24 (m)"),
    ("small_arm", {"fore": "0"}, "fore must be greater than 0"),
]


@pytest.mark.parametrize(("name", "mappings", "expected"), BAD)
def test_an_impossible_argument_is_named(name: str, mappings: dict[str, str], expected: str) -> None:
    with pytest.raises(xacro.XacroException) as caught:
        xacro.process_file(str(ROBOTS / f"{name}.urdf.xacro"), mappings=mappings)
    first = str(caught.value).splitlines()[0]
    assert first.startswith(f"{name}: argument {expected}"), first


# -------------------------------------------------------------------------------------------- mechanics


@each_case
def test_every_body_is_seen_touched_and_weighed(name: str, variant: int) -> None:
    """Primitives in known colours only; a body's inertia is that of its homogeneous collision shape."""
    root = ET.fromstring(expand(name, variant))
    colours = {m.attrib["name"] for m in root.findall("material") if m.find("color") is not None}
    solids = pin.buildGeomFromUrdfString(model_of(name, variant), expand(name, variant), pin.COLLISION)
    shapes = {solid.name.rsplit("_", 1)[0]: solid.geometry for solid in solids.geometryObjects}
    for link in root.findall("link"):
        parts = [len(link.findall(tag)) for tag in ("visual", "collision", "inertial")]
        if link.attrib["name"] in ("base_footprint", "ee"):
            assert parts == [0, 0, 0]
            continue
        assert parts[0] >= 1
        assert parts[1:] == [1, 1], link.attrib["name"]
        assert {find(v, "material").attrib["name"] for v in link.findall("visual")} <= colours
        for shape in link.iterfind("*/geometry/*"):
            assert shape.tag in ("box", "cylinder", "sphere")
            sizes = [float(number) for value in shape.attrib.values() for number in value.split()]
            assert min(sizes) > 0, link.attrib["name"]
        solid, inertial = shapes[link.attrib["name"]], find(link, "inertial")
        assert find(inertial, "origin").attrib == find(link, "collision/origin").attrib
        mass = float(find(inertial, "mass").attrib["value"])
        moments = np.array([float(find(inertial, "inertia").attrib[k]) for k in ("ixx", "iyy", "izz")])
        expected = mass * solid.computeMomentofInertia().diagonal() / solid.computeVolume()
        np.testing.assert_allclose(moments, expected, rtol=1e-12)
        assert 0 < 2 * moments.max() <= moments.sum() * (1 + 1e-12)


# ------------------------------------------------------------------------------------------------ looks


class Drawing:
    """The robot's visuals, placed at a configuration."""

    def __init__(self, name: str, variant: int) -> None:
        self.model = model_of(name, variant)
        self.shapes = pin.buildGeomFromUrdfString(self.model, expand(name, variant), pin.VISUAL)
        self.data, self.placed = self.model.createData(), self.shapes.createData()
        self.body = [shape.parentJoint for shape in self.shapes.geometryObjects]
        self.link = [self.model.frames[shape.parentFrame].name for shape in self.shapes.geometryObjects]

    def place(self, angles: dict[str, float]) -> list[pin.SE3]:
        q = at(self.model, angles)
        pin.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed, q)
        return list(self.placed.oMg)

    def gaps(self, pairs: list[tuple[int, int]]) -> list[float]:
        """The distances between shapes where they were placed, m; negative where they overlap."""
        distances = []
        for i, j in pairs:
            request, result = pin.hppfcl.DistanceRequest(), pin.hppfcl.DistanceResult()
            one, other = (self.shapes.geometryObjects[k].geometry for k in (i, j))
            distances.append(
                pin.hppfcl.distance(one, self.placed.oMg[i], other, self.placed.oMg[j], request, result)
            )
        return distances


@each_case
def test_no_part_floats(name: str, variant: int) -> None:
    """Over gaps no wider than a joint's play, one gets from any part to any other."""
    drawing = Drawing(name, variant)
    drawing.place({})
    count = drawing.shapes.ngeoms
    reached, waiting, play = {0}, [0], 0.004
    left = set(range(1, count))
    while waiting:
        k = waiting.pop()
        pairs = [(k, other) for other in sorted(left)]
        near = {other for (_, other), gap in zip(pairs, drawing.gaps(pairs), strict=True) if gap < play}
        reached |= near
        left -= near
        waiting += near
    assert not [drawing.shapes.geometryObjects[k].name for k in sorted(left)]


@each_base
def test_all_wheels_stand_on_the_ground(name: str, variant: int) -> None:
    """Every wheel touches it, whatever the casters, hitches and steering do, and nothing is below it."""
    drawing, rng = Drawing(name, variant), np.random.default_rng(6)
    radius = given(name, variant)["wheel_radius"]
    for angles in ({}, random_angles(drawing.model, rng)):
        lowest: dict[str, float] = {}
        for shape, place, link in zip(
            drawing.shapes.geometryObjects, drawing.place(angles), drawing.link, strict=True
        ):
            height = place.translation[2] - reach_down(shape.geometry, place.rotation)
            lowest[link] = min(lowest.get(link, np.inf), height)
        wheels = {link: height for link, height in lowest.items() if "wheel" in link}
        assert len(wheels) >= 4
        # A mecanum wheel is round to a few percent: between two of its rollers there is a gap.
        rough = 0.08 if name == "omni_base" and angles else 0.01 if name == "omni_base" else 1e-9
        for height in wheels.values():
            assert -1e-9 <= height <= rough * radius
        others = [height for link, height in lowest.items() if link not in wheels]
        assert min(others) > 0.2 * radius


@each_base
def test_wheels_are_seen_turning(name: str, variant: int) -> None:
    """A mark on each wheel lies off its axle, so that no part of a turn looks like another."""
    shapes = Drawing(name, variant).shapes.geometryObjects
    for wheel in layout_of(name, variant).wheels:
        link = wheel.joint.removesuffix("_joint")
        marks = [
            shape
            for shape in shapes
            if shape.name.rsplit("_", 1)[0] == link and np.allclose(shape.meshColor[:3], [0.96, 0.46, 0.10])
        ]
        assert len(marks) == 1, link
        x, _, z = marks[0].placement.translation
        assert math.hypot(x, z) > 0.3 * wheel.radius


@pytest.mark.parametrize("variant", range(3))
def test_mecanum_rollers_touch_the_ground_as_the_platform_says(variant: int) -> None:
    """The lowest roller's axle points along the direction in which the platform says that the wheel grips."""
    drawing = Drawing("omni_base", variant)
    layout = layout_of("omni_base", variant)
    platform = Mecanum.fit(layout)
    places = drawing.place({})
    for wheel in layout.wheels:
        link = wheel.joint.removesuffix("_joint")
        lowest = min((p.translation[2], k) for k, p in enumerate(places) if drawing.link[k] == link)[1]
        axle = places[lowest].rotation[:, 2]
        angle = platform.roller(wheel.x, wheel.y)
        np.testing.assert_allclose(abs(axle @ [math.cos(angle), math.sin(angle), 0.0]), 1.0, atol=1e-9)


@each_case
def test_joints_turn_freely(name: str, variant: int) -> None:
    """What a wheel, fork or trailer meets in its neighbour (an axle its hub) it meets at every angle."""
    drawing, rng = Drawing(name, variant), np.random.default_rng(8)
    if name == "small_arm":
        angles = [random_angles(drawing.model, rng) for _ in range(8)]
    else:
        # The steered wheels and the casters follow; they go as far as the car and the trailers let them.
        names = [str(n) for n in drawing.model.names[1:]]
        car = "front_left_steer_joint" in names
        angles = []
        for part in np.linspace(-1.0, 1.0, 8):
            turned = {n: float(rng.uniform(-3, 3)) for n in names}
            for n in names:
                if n in ("hitch1", "hitch2"):
                    turned[n] = part * given(name, variant)["max_fold"] * (1 if n == "hitch1" else -1)
                if n == "steering":
                    turned[n] = part * given(name, variant)["max_steering"]
            if car:
                g = given(name, variant)
                bend = math.tan(turned["steering"]) / g["wheelbase"]
                for side, sign in (("left", 1), ("right", -1)):
                    pivot = drawing.model.jointPlacements[
                        drawing.model.getJointId(f"front_{side}_steer_joint")
                    ].translation[1]
                    turned[f"front_{side}_steer_joint"] = math.atan2(g["wheelbase"] * bend, 1 - bend * pivot)
                    assert pivot * sign > 0
            angles.append(turned)
    pairs = [
        (i, j)
        for i, j in itertools.combinations(range(drawing.shapes.ngeoms), 2)
        if drawing.body[i] != drawing.body[j]
        and (name != "small_arm" or drawing.model.parents[drawing.body[j]] == drawing.body[i])
    ]
    drawing.place({})
    first = {pair for pair, gap in zip(pairs, drawing.gaps(pairs), strict=True) if gap < 0.0005}
    for turned in angles:
        drawing.place(turned)
        met = {pair for pair, gap in zip(pairs, drawing.gaps(pairs), strict=True) if gap < 0.0005}
        shapes = drawing.shapes.geometryObjects
        assert met == first, [(shapes[i].name, shapes[j].name) for i, j in met ^ first]


@each_case
def test_no_two_colours_share_a_surface(name: str, variant: int) -> None:
    """Faces that coincide flicker in a viewer; of two colours, none come within 0.05 mm of one another."""
    drawing = Drawing(name, variant)
    places = drawing.place({})
    shapes = drawing.shapes.geometryObjects
    bounds, faces = [], [surface(shape.geometry) for shape in shapes]
    for shape, place in zip(shapes, places, strict=True):
        shape.geometry.computeLocalAABB()
        bounds.append((place.translation, shape.geometry.aabb_radius))
    sharing = []
    for i, j in itertools.permutations(range(len(shapes)), 2):
        apart = np.linalg.norm(bounds[i][0] - bounds[j][0]) - bounds[i][1] - bounds[j][1]
        if apart < 1e-4 and drawing.body[i] == drawing.body[j]:
            if np.array_equal(shapes[i].meshColor, shapes[j].meshColor):
                continue
            points, normals = faces[i]
            relative = places[j].actInv(places[i])
            points = points @ relative.rotation.T + relative.translation
            if coincident(shapes[j].geometry, points, normals @ relative.rotation.T, 5e-5).any():
                sharing.append((shapes[i].name, shapes[j].name))
    assert not sharing
