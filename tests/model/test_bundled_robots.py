"""The bundled robots: their kinematics against the paper's closed forms, their mechanics against physics."""

from __future__ import annotations

import io
import itertools
import shutil
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
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

pytestmark = pytest.mark.usefixtures("xacro_each_time")

ROBOTS = ROOT / "robots"

# The geometry that the xacro files have to have by default; 2r's height is ours, the rest is the paper's.
DEFAULTS = MappingProxyType(
    {
        "unicycle_2r": {"d": 0.3, "h": 0.3, "l1": 0.5, "l2": 0.3, "wheel_radius": 0.1, "track": 0.4},
        "unicycle_3r": {
            "d": 0.3,
            "h": 0.3,
            "l1": 0.4,
            "l2": 0.5,
            "l3": 0.4,
            "wheel_radius": 0.1,
            "track": 0.4,
        },
    }
)
ARM = MappingProxyType({"unicycle_2r": ("q1", "q2"), "unicycle_3r": ("q1", "q2", "q3")})
VARIANTS = MappingProxyType(
    {
        "default": {},
        "arm over the axle": {"d": 0.0},
        "arm far ahead": {"d": 1.0},
        "arm behind": {"d": -0.4},
        "arm far behind": {"d": -0.9},
        "short links": {"l1": 0.06, "l2": 0.05},
        "long links": {"l1": 1.5, "l2": 1.2},
        "small platform": {"wheel_radius": 0.04, "track": 0.24, "h": 0.12, "d": 0.1},
        "large wheels": {"wheel_radius": 0.25, "track": 0.8, "h": 0.6},
        "low deck": {"h": 0.2},
    }
)
CASES = [(robot, variant) for robot in DEFAULTS for variant in VARIANTS]
#: One variant for each of the lengths, on both sides of the axle.
USUAL = {"default", "arm behind", "short links", "large wheels"}
each_case = pytest.mark.parametrize(("robot", "variant"), thinned(CASES, lambda case: case[1] in USUAL))
each_robot = pytest.mark.parametrize("robot", list(DEFAULTS))


@cache
def expand(robot: str, variant: str = "default") -> str:
    """The robot's URDF text, with the variant's arguments."""
    mappings = {name: str(value) for name, value in VARIANTS[variant].items()}
    text: str = xacro.process_file(str(ROBOTS / f"{robot}.urdf.xacro"), mappings=mappings).toxml()
    return text


def find(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    assert found is not None, path
    return found


def geometry(robot: str, variant: str) -> dict[str, float]:
    return {**DEFAULTS[robot], **VARIANTS[variant]}


@cache
def model_of(robot: str, variant: str = "default") -> pin.Model:
    return pin.buildModelFromXML(expand(robot, variant))


def at(model: pin.Model, angles: dict[str, float]) -> NDArray[np.float64]:
    """Pinocchio's configuration, in which a continuous joint is a (cos, sin) pair."""
    q = pin.neutral(model)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        assert joint.nq == 2
        q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
    return q


def placement(model: pin.Model, q: NDArray[np.float64], frame: str) -> pin.SE3:
    assert model.existFrame(frame)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(frame)].copy()


def closed_form(robot: str, g: dict[str, float], a: dict[str, float]) -> tuple[NDArray[np.float64], ...]:
    """The paper's end-effector position, and the last link's direction, for the platform at the origin.

    Height is not part of the planar robot's formula: NaN stands for it.
    """
    c, s = np.cos, np.sin
    if robot == "unicycle_2r":
        q1, q12 = a["q1"], a["q1"] + a["q2"]
        r = [g["d"] + g["l1"] * c(q1) + g["l2"] * c(q12), g["l1"] * s(q1) + g["l2"] * s(q12), np.nan]
        return np.array(r), np.array([c(q12), s(q12), 0.0])
    q1, q2, q23 = a["q1"], a["q2"], a["q2"] + a["q3"]
    reach = g["l2"] * s(q2) + g["l3"] * s(q23)
    r = [g["d"] + c(q1) * reach, s(q1) * reach, g["h"] + g["l1"] + g["l2"] * c(q2) + g["l3"] * c(q23)]
    return np.array(r), np.array([c(q1) * s(q23), s(q1) * s(q23), c(q23)])


# ---------------------------------------------------------------------------------------------- kinematics


@each_case
def test_end_effector_is_where_the_paper_says(robot: str, variant: str) -> None:
    """Pinocchio and yourdfpy, which share no code, against equation (14) and section V-B's kinematic map."""
    rng = np.random.default_rng(7)
    model = model_of(robot, variant)
    twin = yourdfpy.URDF.load(io.BytesIO(expand(robot, variant).encode()), load_meshes=False)
    names = (*ARM[robot], "left_wheel_joint", "right_wheel_joint")
    heights = []
    for _ in range(20):
        angles = dict(zip(names, rng.uniform(-2 * np.pi, 2 * np.pi, len(names)), strict=True))
        ee = placement(model, at(model, angles), "ee")
        expected, direction = closed_form(robot, geometry(robot, variant), angles)
        planar = np.isnan(expected)
        np.testing.assert_allclose(ee.translation[~planar], expected[~planar], atol=1e-13)
        np.testing.assert_allclose(ee.rotation[:, 0], direction, atol=1e-13)
        heights.append(ee.translation[2])

        twin.update_cfg(angles)
        np.testing.assert_allclose(twin.get_transform("ee", "base_footprint"), ee.homogeneous, atol=1e-13)
    if robot == "unicycle_2r":
        assert np.ptp(heights) < 1e-13
        assert heights[0] > geometry(robot, variant)["h"]


@each_case
def test_wheels_roll_without_slipping(robot: str, variant: str) -> None:
    """Turning at v/r about +y while the platform drives at v, each tyre's lowest point stands still."""
    model, g = model_of(robot, variant), geometry(robot, variant)
    data, speed = model.createData(), 0.7
    for side, sign in (("left", 1.0), ("right", -1.0)):
        v = np.zeros(model.nv)
        v[model.joints[model.getJointId(f"{side}_wheel_joint")].idx_v] = speed / g["wheel_radius"]
        pin.forwardKinematics(model, data, pin.neutral(model), v)
        frame = model.getFrameId(f"{side}_wheel")
        pin.updateFramePlacement(model, data, frame)
        centre = data.oMf[frame].translation
        np.testing.assert_allclose(centre, [0.0, sign * g["track"] / 2, g["wheel_radius"]], atol=1e-15)
        spin = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        slip = np.array([speed, 0.0, 0.0]) + spin.linear + np.cross(spin.angular, [0.0, 0.0, -centre[2]])
        np.testing.assert_allclose(slip, 0.0, atol=1e-12)


# ----------------------------------------------------------------------------------------- description


@each_robot
def test_tree_and_names(robot: str) -> None:
    root = ET.fromstring(expand(robot))
    joints = {joint.attrib["name"]: joint for joint in root.iter("joint")}
    links = [link.attrib["name"] for link in root.iter("link")]
    moving = {name for name, joint in joints.items() if joint.attrib["type"] != "fixed"}

    assert root.attrib["name"] == robot
    assert set(links) - {find(j, "child").attrib["link"] for j in joints.values()} == {"base_footprint"}
    assert moving == {"left_wheel_joint", "right_wheel_joint", *ARM[robot]}
    assert {*(f"link{i + 1}" for i in range(len(ARM[robot]))), "arm_base", "base_link", "ee"} <= set(links)
    # The loader adds x, y and theta; a frame found by its name must be one frame.
    names = [*links, *joints]
    assert len(set(names)) == len(names)
    assert not {"x", "y", "theta", "world", "universe"} & set(names)
    for name in moving:
        assert joints[name].attrib["type"] == "continuous"
        limit = find(joints[name], "limit").attrib
        assert float(limit["velocity"]) > 0
        assert float(limit["effort"]) > 0


@each_case
def test_every_body_is_seen_touched_and_weighed(robot: str, variant: str) -> None:
    """Primitives in known colours only; every link but the two bare frames has shapes and mass."""
    root = ET.fromstring(expand(robot, variant))
    colours = {m.attrib["name"] for m in root.findall("material") if m.find("color") is not None}
    for link in root.findall("link"):
        parts = [len(link.findall(tag)) for tag in ("visual", "collision", "inertial")]
        if link.attrib["name"] in ("base_footprint", "ee"):
            assert parts == [0, 0, 0]
            continue
        assert min(parts) >= 1, link.attrib["name"]
        assert {find(v, "material").attrib["name"] for v in link.findall("visual")} <= colours
        for shape in link.iterfind("*/geometry/*"):
            assert shape.tag in ("box", "cylinder", "sphere")
            sizes = [float(number) for value in shape.attrib.values() for number in value.split()]
            assert min(sizes) > 0, link.attrib["name"]


@each_case
def test_inertia_is_that_of_the_homogeneous_collision_shape(robot: str, variant: str) -> None:
    """coal integrates each shape's own moment; a body's moments obey the triangle inequality."""
    root = ET.fromstring(expand(robot, variant))
    solids = pin.buildGeomFromUrdfString(model_of(robot, variant), expand(robot, variant), pin.COLLISION)
    shapes = {solid.name.rsplit("_", 1)[0]: solid.geometry for solid in solids.geometryObjects}
    bodies = [link for link in root.findall("link") if link.find("inertial") is not None]
    assert len(bodies) == len(shapes) == solids.ngeoms
    for link in bodies:
        shape, inertial = shapes[link.attrib["name"]], find(link, "inertial")
        assert find(inertial, "origin").attrib == find(link, "collision/origin").attrib
        mass = float(find(inertial, "mass").attrib["value"])
        moments = np.array([float(find(inertial, "inertia").attrib[k]) for k in ("ixx", "iyy", "izz")])
        expected = mass * shape.computeMomentofInertia().diagonal() / shape.computeVolume()
        np.testing.assert_allclose(moments, expected, rtol=1e-12)
        assert mass > 0
        assert moments.min() > 0
        assert 2 * moments.max() <= moments.sum() * (1 + 1e-12)


@each_robot
def test_masses_are_plausible(robot: str) -> None:
    root = ET.fromstring(expand(robot))
    mass = {
        k.attrib["name"]: float(find(k, "inertial/mass").attrib["value"])
        for k in root
        if k.find("inertial") is not None
    }
    links = {name: value for name, value in mass.items() if name.startswith("link")}
    assert sum(mass.values()) - sum(links.values()) - mass["gripper"] == pytest.approx(15.0)
    assert all(0.5 <= value <= 2.0 for value in links.values())


# ----------------------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    ("robot", "name", "value", "expected"),
    [
        *(
            ("unicycle_2r", name, "0", "greater than 0")
            for name in ("l1", "l2", "wheel_radius", "track", "h")
        ),
        *(
            ("unicycle_3r", name, "-0.1", "greater than 0")
            for name in ("l1", "l2", "l3", "wheel_radius", "h")
        ),
        ("unicycle_2r", "h", "0.19", "at least 2*wheel_radius"),
        *(("unicycle_2r", "l2", value, "finite number") for value in ("nan", "inf", "long", "true", "")),
        *(("unicycle_3r", "d", value, "finite number") for value in ("-inf", "ahead")),
    ],
)
def test_impossible_argument_is_named(robot: str, name: str, value: str, expected: str) -> None:
    with pytest.raises(xacro.XacroException) as caught:
        xacro.process_file(str(ROBOTS / f"{robot}.urdf.xacro"), mappings={name: value})
    first = str(caught.value).splitlines()[0]
    assert first.startswith(f"{robot}: argument {name} must be ")
    assert expected in first


@each_robot
def test_defaults_are_the_papers(robot: str) -> None:
    given = {name: str(value) for name, value in DEFAULTS[robot].items()}
    path = ROBOTS / f"{robot}.urdf.xacro"
    assert xacro.process_file(str(path), mappings=given).toxml() == expand(robot)
    declared = {arg.attrib["name"] for arg in ET.parse(path).iter("{http://www.ros.org/wiki/xacro}arg")}
    assert declared == set(given)


@each_robot
def test_works_from_another_place(robot: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As from an installed wheel: the includes are found beside the file, wherever one stands."""
    shutil.copytree(ROBOTS, tmp_path / "elsewhere")
    monkeypatch.chdir(tmp_path)
    moved = xacro.process_file(f"elsewhere/{robot}.urdf.xacro").toxml()
    # The xml's first comment names the file that it was made from.
    assert ET.canonicalize(moved) == ET.canonicalize(expand(robot))


# ----------------------------------------------------------------------------------------------- looks


class Drawing:
    """The robot's visuals, placed at a configuration."""

    def __init__(self, robot: str, variant: str) -> None:
        self.model = model_of(robot, variant)
        self.shapes = pin.buildGeomFromUrdfString(self.model, expand(robot, variant), pin.VISUAL)
        self.pairs = list(itertools.combinations(range(self.shapes.ngeoms), 2))
        for i, j in self.pairs:
            self.shapes.addCollisionPair(pin.CollisionPair(i, j))
        self.data, self.placed = self.model.createData(), self.shapes.createData()
        self.body = [shape.parentJoint for shape in self.shapes.geometryObjects]
        self.link = [self.model.frames[shape.parentFrame].name for shape in self.shapes.geometryObjects]

    def gaps(self, angles: dict[str, float]) -> dict[tuple[int, int], float]:
        """The distance between each two shapes in metres, negative where they overlap."""
        q = at(self.model, angles)
        pin.computeDistances(self.model, self.data, self.shapes, self.placed, q)
        return dict(zip(self.pairs, (r.min_distance for r in self.placed.distanceResults), strict=True))


@each_case
def test_no_part_floats(robot: str, variant: str) -> None:
    """Over gaps no wider than a joint's play, one gets from any part to any other: the arm is mounted."""
    drawing = Drawing(robot, variant)
    clusters = [{k} for k in range(drawing.shapes.ngeoms)]
    for (i, j), gap in drawing.gaps({}).items():
        a, b = (next(c for c in clusters if k in c) for k in (i, j))
        if gap < 0.004 and a is not b:
            clusters.remove(b)
            a |= b
    loose = [[drawing.shapes.geometryObjects[k].name for k in cluster] for cluster in clusters[1:]]
    assert not loose


@each_case
def test_joints_turn_freely(robot: str, variant: str) -> None:
    """What a link meets in its neighbour (a hub meets its pin) is the same at every angle: it cuts nothing.

    The planar arm meets nothing at all: neither the platform under it, nor itself when it folds.
    """
    drawing = Drawing(robot, variant)
    parent = drawing.model.parents
    neighbours = [
        (i, j)
        for i, j in drawing.pairs
        if (a := drawing.body[i]) != (b := drawing.body[j])
        and (robot == "unicycle_2r" or parent[a] == b or parent[b] == a)
    ]
    # An elbow arm with a short link cannot fold flat: its joints would meet the link before.
    range_ = np.pi if robot == "unicycle_2r" or "links" not in variant else 2.4
    names = [name for name in drawing.model.names if name != "universe"]
    samples = np.random.default_rng(3).uniform(-range_, range_, (12, len(names)))
    met = []
    for angles in (np.zeros(len(names)), np.full(len(names), range_), *samples):
        gaps = drawing.gaps(dict(zip(names, angles, strict=True)))
        met.append({pair for pair in neighbours if gaps[pair] < 0.0005})
    assert all(pairs == met[0] for pairs in met)
    assert robot == "unicycle_3r" or not met[0]


@each_case
def test_stands_on_the_ground(robot: str, variant: str) -> None:
    """Both tyres and the caster touch the ground, and nothing else comes near it."""
    drawing = Drawing(robot, variant)
    drawing.gaps({})
    lowest: dict[str, float] = {}
    for shape, place, link in zip(
        drawing.shapes.geometryObjects, drawing.placed.oMg, drawing.link, strict=True
    ):
        height = place.translation[2] - reach_down(shape.geometry, place.rotation)
        lowest[link] = min(lowest.get(link, np.inf), height)
    for link in ("left_wheel", "right_wheel", "caster"):
        assert lowest.pop(link) == pytest.approx(0.0, abs=1e-12)
    assert min(lowest.values()) > 0.2 * geometry(robot, variant)["wheel_radius"]


@each_robot
def test_wheels_are_seen_turning(robot: str) -> None:
    """One mark on each wheel lies off the axle, so that no part of a turn looks like another."""
    shapes = pin.buildGeomFromUrdfString(model_of(robot), expand(robot), pin.VISUAL).geometryObjects
    for side in ("left", "right"):
        centres = [s.placement.translation for s in shapes if s.name.startswith(f"{side}_wheel")]
        assert sum(np.hypot(c[0], c[2]) > 0.02 for c in centres) == 1


@each_case
def test_no_two_colours_share_a_surface(robot: str, variant: str) -> None:
    """Faces that coincide flicker in a viewer; of two colours, none come within 0.05 mm of one another."""
    drawing = Drawing(robot, variant)
    drawing.gaps({})
    shapes = drawing.shapes.geometryObjects
    faces = [surface(shape.geometry) for shape in shapes]
    for i, j in [*drawing.pairs, *((j, i) for i, j in drawing.pairs)]:
        if drawing.body[i] == drawing.body[j] and not np.array_equal(
            shapes[i].meshColor, shapes[j].meshColor
        ):
            points, normals = faces[i]
            relative = drawing.placed.oMg[j].actInv(drawing.placed.oMg[i])
            points = points @ relative.rotation.T + relative.translation
            shared = coincident(shapes[j].geometry, points, normals @ relative.rotation.T, 5e-5)
            assert not shared.any(), (shapes[i].name, shapes[j].name)
