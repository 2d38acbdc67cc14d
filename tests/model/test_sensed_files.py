"""Clouds and maps read from files that other tools wrote, or that formulas say."""

from __future__ import annotations

import io
import shutil
import struct
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from PIL import Image
from places import UR5

import nmm
from nmm.base.errors import InputError
from nmm.model.collisions.elements.boxes import surface
from nmm.model.collisions.pairs import query_shapes
from nmm.model.collisions.sensed.map_files import read_image


def mounted() -> nmm.Robot:
    """A UR5 on a differential drive: boxes, cylinders and meshes."""
    return nmm.mount(nmm.load("differential_base"), nmm.load(UR5), prefix="ur5_")


POINTS = np.random.default_rng(1).uniform(-3.0, 3.0, (200, 3))


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_a_ply_of_trimesh_has_its_points(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "seen.ply"
    file.write_bytes(trimesh.PointCloud(POINTS).export(file_type="ply", encoding=encoding))
    cloud = nmm.PointCloud.load(file, radius=0.02)
    assert np.abs(cloud.points - POINTS).max() < 1e-6  # as f32, or as decimals
    assert (cloud.name, cloud.radius) == ("seen", 0.02)


def test_a_binary_ply_of_doubles_beside_colours_is_read(tmp_path: Path) -> None:
    head = "ply\nformat binary_big_endian 1.0\nelement vertex 200\nproperty double x\nproperty double y\n"
    head += "property double z\nproperty uchar red\nend_header\n"
    file = tmp_path / "seen.ply"
    file.write_bytes(head.encode() + b"".join(struct.pack(">dddB", *point, 7) for point in POINTS))
    assert np.array_equal(nmm.PointCloud.load(file).points, POINTS)


def pcd(data: str, extra: bool = True) -> bytes:
    """As the Point Cloud Library writes it: fields beside x, y and z, and of several numbers."""
    names = ["x", "y", "z", "normal", "rgb"] if extra else ["x", "y", "z"]
    counts = [1, 1, 1, 3, 1][: len(names)]
    head = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
    head += f"FIELDS {' '.join(names)}\nSIZE {' '.join('4' * len(names))}\n"
    head += f"TYPE {' '.join('F' * len(names))}\n"
    head += f"COUNT {' '.join(map(str, counts))}\nWIDTH {len(POINTS)}\nHEIGHT 1\n"
    head += f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(POINTS)}\nDATA {data}\n"
    rows = np.zeros((len(POINTS), sum(counts)), dtype="<f4")
    rows[:, :3] = POINTS
    if data == "binary":
        return head.encode() + rows.tobytes()
    return (head + "\n".join(" ".join(map(repr, map(float, row))) for row in rows)).encode()


@pytest.mark.parametrize("extra", [True, False])
@pytest.mark.parametrize("data", ["ascii", "binary"])
def test_a_pcd_has_its_points(tmp_path: Path, data: str, extra: bool) -> None:
    file = tmp_path / "seen.pcd"
    file.write_bytes(pcd(data, extra))
    assert np.array_equal(nmm.PointCloud.load(file).points, POINTS.astype(np.float32))


def test_an_npz_has_its_points_and_holds_no_objects(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", points=POINTS, colours=np.zeros(3))
    assert np.array_equal(nmm.PointCloud.load(tmp_path / "a.npz").points, POINTS)
    np.savez(tmp_path / "b.npz", scan=POINTS.astype(np.float32))
    assert np.array_equal(nmm.PointCloud.load(tmp_path / "b.npz").points, POINTS.astype(np.float32))
    np.savez(tmp_path / "c.npz", points=np.array([print], dtype=object))
    with pytest.raises(InputError, match=r"c\.npz"):
        nmm.PointCloud.load(tmp_path / "c.npz")


def written(save: Callable[..., None]) -> bytes:
    """What NumPy writes of the points."""
    content = io.BytesIO()
    save(content, POINTS)
    return content.getvalue()


def spoilt(content: bytes) -> bytes:
    """With bytes in the middle that no stream of zlib has."""
    return content[:100] + b"\xff" * 100 + content[200:]


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.pcd", pcd("binary")[:-5], "ends after 199 of 200"),
        ("a.pcd", pcd("ascii")[:-500], "ends after"),
        ("a.pcd", pcd("binary").replace(b"DATA binary", b"DATA binary_compressed"), "pcl_convert"),
        ("a.pcd", pcd("binary").replace(b"FIELDS x", b"FIELDS a"), "FIELDS"),
        ("a.pcd", b"VERSION 0.7\n", "DATA"),
        ("a.pcd", pcd("ascii").replace(b"SIZE 4", b"SIZE 5"), "header"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "PLY"),
        ("a.npz", b"PK\x03\x04 no archive", "NPZ"),
        ("a.npz", written(np.save), "single array"),
        ("a.npz", spoilt(written(np.savez_compressed)), "NPZ"),
        ("a.pcd", pcd("ascii").replace(b"COUNT 1", b"COUNT 1000000000000"), "header"),
        ("a.xyz", b"1 2 3", r"\.ply, \.pcd or \.npz"),
        ("a.npz", None, "cannot be read"),
    ],
)
def test_a_damaged_cloud_is_refused_by_name(
    tmp_path: Path, name: str, content: bytes | None, says: str
) -> None:
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=says) as refused:
        nmm.PointCloud.load(file)
    assert name in str(refused.value)
    assert len(str(refused.value)) <= 300


def test_a_cloud_leaves_out_what_is_no_point() -> None:
    rows = np.vstack([POINTS, [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf]]])
    for dtype in (np.float32, np.float64):
        cloud = nmm.PointCloud(rows.astype(dtype))
        assert (len(cloud.points), cloud.left_out) == (200, 3)
        assert cloud.transformed(np.eye(4)).left_out == 3
    for wrong in (POINTS[:, :2], POINTS[0], "cloud", [[1, 2], [3]], np.full((3, 3), np.nan), [[0, 0, 1e9]]):
        with pytest.raises(InputError, match="obstacle point cloud"):
            nmm.PointCloud(wrong)  # type: ignore[arg-type]  # that is the question


def test_a_cloud_in_other_axes_is_turned_and_moved() -> None:
    rng = np.random.default_rng(2)
    T = pin.SE3.Random()
    moved = nmm.PointCloud(POINTS).transformed(T.homogeneous)
    expected = np.array([T.act(point) for point in POINTS])
    assert np.allclose(moved.points, expected, atol=1e-12)
    assert np.allclose(moved.transformed(T.inverse().homogeneous).points, POINTS, atol=1e-12)
    with pytest.raises(InputError, match="rotation"):
        nmm.PointCloud(POINTS).transformed(np.diag([1.0, 2.0, 1.0, 1.0]))
    with pytest.raises(InputError):
        nmm.PointCloud(POINTS).transformed(rng.uniform(size=3))


def test_no_ball_of_a_cloud_leaves_a_thinned_one() -> None:
    cloud = nmm.PointCloud(POINTS, radius=0.03)
    thin = cloud.thinned(0.5)
    apart = np.linalg.norm(cloud.points[:, None] - thin.points[None], axis=2).min(axis=1)
    assert len(thin.points) < len(cloud.points)
    assert np.all(apart + cloud.radius <= thin.radius + 1e-12)


@pytest.mark.parametrize("name", ["ur5", "unicycle_3r"])
def test_a_robots_own_points_are_left_out_and_no_others(name: str) -> None:
    """Against Coal, point by point and shape by shape."""
    rng = np.random.default_rng(3)
    robot = mounted() if name == "ur5" else nmm.load(name)
    q = robot.following.placed(rng.uniform(*np.clip(robot.q_limits, -1.0, 1.0).T))
    shapes = query_shapes(robot)
    places = pin.GeometryData(shapes)
    pin.updateGeometryPlacements(robot.model, robot.model.createData(), shapes, places, q)
    middle = places.oMg[len(places.oMg) - 1].translation
    points = middle + rng.normal(0.0, 0.25, (400, 3))
    near = np.zeros(len(points), dtype=bool)
    for k, point in enumerate(points):
        for i, shape in enumerate(shapes.geometryObjects):
            pose = coal.Transform3s(places.oMg[i].rotation, places.oMg[i].translation)
            at = coal.Transform3s(np.eye(3), point)
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            near[k] |= coal.distance(shape.geometry, pose, coal.Sphere(1e-9), at, request, result) <= 0.05
    assert 20 < near.sum() < 380
    others = nmm.PointCloud(points).without(robot, q, padding=0.05)
    assert np.array_equal(others.points, points[~near])
    with pytest.raises(InputError, match="without"):
        nmm.PointCloud(middle[None]).without(robot, q)


# Maps: by formula, pixel by pixel, as map_io.cpp of Nav2 has them.
def save_map(folder: Path, pixels: np.ndarray, **keys: object) -> Path:
    Image.fromarray(pixels).save(folder / "map.png")
    values = {"image": "map.png", "resolution": 0.05, "origin": "[-1.0, 2.0, 0.0]", "negate": 0}
    values |= {"free_thresh": 0.196, "occupied_thresh": 0.65} | keys
    (folder / "map.yaml").write_text("\n".join(f"{key}: {value}" for key, value in values.items()))
    return folder / "map.yaml"


SHADES = np.arange(256, dtype=np.uint8).reshape(16, 16)


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [0, 1, "true", "false"])
def test_each_shade_is_the_cell_that_nav2_makes_of_it(tmp_path: Path, mode: str, negate: object) -> None:
    room = nmm.OccupancyMap.load(save_map(tmp_path, SHADES, mode=mode, negate=negate), lethal=1)
    for shade in range(256):
        share = shade / 255.0 if negate in (1, "true") else 1.0 - shade / 255.0
        if mode == "raw":
            expected = shade if shade <= 100 else -1
        elif share > 0.65:
            expected = 100
        elif share < 0.196:
            expected = 0
        elif mode == "scale":
            expected = round((share - 0.196) / (0.65 - 0.196) * 100)
        else:
            expected = -1
        row, column = divmod(shade, 16)
        assert room.cells[15 - row, column] == expected, shade


def test_a_maps_first_row_of_pixels_is_its_top_and_its_yaw_turns_it(tmp_path: Path) -> None:
    pixels = np.full((4, 6), 255, dtype=np.uint8)
    pixels[0, 5] = 0  # the upper right corner
    room = nmm.OccupancyMap.load(save_map(tmp_path, pixels, origin="[1.0, 2.0, 1.5707963267948966]"))
    assert np.argwhere(room.full).tolist() == [[3, 5]]
    centre = room.at(0.0).act(room.shape.centres[0])  # type: ignore[attr-defined]  # of its elements
    # 5.5 cells along and 3.5 across, turned by 90°
    assert np.allclose(centre, [1.0 - 3.5 * 0.05, 2.0 + 5.5 * 0.05, 1.0])
    assert room.cell_of(centre[0], centre[1]) == (3, 5)


@pytest.mark.parametrize(
    ("mode", "transparent"), [("trinary", -1), ("scale", -1), ("raw", -1)], ids=lambda value: str(value)
)
def test_opacity_counts_as_nav2_has_it(tmp_path: Path, mode: str, transparent: int) -> None:
    pixels = np.full((1, 3, 4), 255, dtype=np.uint8)
    pixels[0, 1] = 128, 128, 128, 0
    pixels[0, 2] = 0, 0, 0, 255
    cells = nmm.OccupancyMap.load(save_map(tmp_path, pixels, mode=mode), unknown="occupied", lethal=1).cells
    # trinary: the mean of 4 channels, 0.376: occ 0.624; black is 0.25: occ 0.75
    expected = {"trinary": [0, -1, 100], "scale": [0, transparent, 100], "raw": [-1, -1, 0]}[mode]
    assert cells.tolist() == [expected]


@pytest.mark.parametrize("most", [100, 255, 1000, 65535])
@pytest.mark.parametrize("kind", ["P2", "P5"])
def test_a_pgms_greatest_value_is_white(tmp_path: Path, kind: str, most: int) -> None:
    values = [0, round(most / 4), round(most / 2), most]
    content = f"{kind}\n# CREATOR: map_saver 0.050 m/pix\n4 1\n{most}\n".encode()
    if kind == "P2":
        content += " ".join(map(str, values)).encode()
    else:
        content += np.array(values, dtype=">u2" if most > 255 else "u1").tobytes()
    (tmp_path / "a.pgm").write_bytes(content)
    image = read_image(tmp_path / "a.pgm")
    assert np.allclose(image.values.ravel() / image.most, np.array(values) / most, atol=0.5 / 255)


def test_bmp_and_palettes_are_read(tmp_path: Path) -> None:
    Image.fromarray(SHADES).save(tmp_path / "a.bmp")
    Image.fromarray(SHADES).convert("P").save(tmp_path / "p.png")
    for name in ("a.bmp", "p.png"):
        assert np.array_equal(read_image(tmp_path / name).values[:, :, 0], SHADES)


@pytest.mark.parametrize("kind", ["RGB", "I;16"])
def test_a_transparent_colour_is_opacity_and_no_channel_of_the_image(tmp_path: Path, kind: str) -> None:
    if kind == "RGB":
        pixels = np.array([[[255, 255, 255], [0, 0, 255], [10, 20, 30]]], dtype=np.uint8)
        Image.fromarray(pixels).save(tmp_path / "a.png", transparency=(10, 20, 30))
    else:
        pixels = np.array([[65535, 0, 300]], dtype=np.uint16)
        Image.fromarray(pixels).save(tmp_path / "a.png", transparency=300)
    image = read_image(tmp_path / "a.png")
    assert image.alpha
    assert np.array_equal(image.values[..., :-1].squeeze(), pixels.squeeze())
    assert (image.values[0, :, -1] / image.most).tolist() == [1.0, 1.0, 0.0]


def test_a_moved_maps_cells_are_where_it_is() -> None:
    room = nmm.OccupancyMap(np.full((4, 6), 100), 0.5, [1.0, 2.0, 0.3])
    room.move_to([3.0, -1.0, 0.2, 0.0, 0.0, np.pi / 2])
    centre = room.at(0.0).act(np.array([2.75, 1.25, 0.0]))
    assert room.cell_of(centre[0], centre[1]) == (2, 5)


def test_a_map_whose_unknown_cells_are_free_by_its_threshold_warns(tmp_path: Path) -> None:
    pixels = np.full((10, 10), 205, dtype=np.uint8)
    pixels[0, 0], pixels[5, :3] = 0, 254
    file = save_map(tmp_path, pixels, free_thresh=0.25)
    with pytest.warns(RuntimeWarning, match="205"):
        assert np.count_nonzero(nmm.OccupancyMap.load(file).full) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.count_nonzero(nmm.OccupancyMap.load(file, unknown="free").full) == 1
        file = save_map(tmp_path, pixels, free_thresh=0.196)
        assert np.count_nonzero(nmm.OccupancyMap.load(file).full) == 97
        assert np.count_nonzero(nmm.OccupancyMap.load(file, unknown="free").full) == 1


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"resolution": -1}, "resolution"),
        ({"origin": "[1, 2]"}, "origin"),
        ({"origin": "2024-13-45"}, "YAML"),
        ({"origin": "!!int x"}, "YAML"),
        ({"origin": "[" * 5000}, "YAML"),
        ({"mode": "ternary"}, "trinary"),
        ({"negate": 2}, "negate"),
        ({"image": "none.png"}, "cannot be read"),
        ({"image": "map.yaml"}, "damaged"),
        ({"free_thresh": 0.9}, "free_thresh"),
        ({"occupied_thresh": "high"}, "occupied_thresh"),
        ({"image": ""}, "image"),
    ],
)
def test_a_wrong_map_is_refused_by_file_and_key(tmp_path: Path, keys: dict[str, object], says: str) -> None:
    file = save_map(tmp_path, SHADES, **keys)
    with pytest.raises(InputError, match=says) as refused:
        nmm.OccupancyMap.load(file)
    assert "map.yaml" in str(refused.value)
    for key in ("image", "resolution", "origin", "negate", "free_thresh", "occupied_thresh"):
        lines = save_map(tmp_path, SHADES).read_text().splitlines()
        file.write_text("\n".join(line for line in lines if not line.startswith(key)))
        with pytest.raises(InputError, match=rf"map\.yaml: {key}"):
            nmm.OccupancyMap.load(file)


def octomap_tool(name: str) -> str | None:
    folder = Path(sys.prefix) / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
    return shutil.which(str(folder / "cmeel.prefix" / "bin" / name)) or shutil.which(name)


@pytest.mark.skipif(octomap_tool("graph2tree") is None, reason="needs OctoMap's tools")
def test_an_octree_that_octomaps_own_tools_made_is_read(tmp_path: Path) -> None:
    """Ends of rays are occupied, and what they went through is free."""
    ends = np.random.default_rng(4).uniform([1.0, -1.0, -0.5], [1.2, 1.0, 0.5], (500, 3))
    lines = ["NODE 0 0 0 0 0 0", *(" ".join(map(repr, map(float, end))) for end in ends)]
    (tmp_path / "scan.log").write_text("\n".join(lines) + "\n")
    tools = [octomap_tool(name) for name in ("log2graph", "graph2tree")]
    library = Path(str(tools[0])).parent.parent / "lib"
    environment = {"LD_LIBRARY_PATH": str(library)}
    for tool, arguments in zip(
        tools, (["scan.log", "scan.graph"], ["-i", "scan.graph", "-o", "scan.bt", "-res", "0.1"]), strict=True
    ):
        subprocess.run(
            [str(tool), *arguments], cwd=tmp_path, check=True, capture_output=True, env=environment
        )
    room = nmm.VoxelMap.load(tmp_path / "scan.bt")
    assert room.resolution == 0.1
    cells = np.floor((ends - room.origin) / 0.1 + 1e-9).astype(int)
    expected = np.zeros_like(room.occupied)
    expected[tuple(cells.T)] = True
    # A cell through which other rays went may be free.
    assert not np.any(room.occupied & ~expected)
    assert np.count_nonzero(room.occupied) > 0.8 * np.count_nonzero(expected)
    with pytest.raises(InputError, match="convert_octree"):
        nmm.VoxelMap.load(tmp_path / "scan.ot")
    (tmp_path / "cut.bt").write_bytes((tmp_path / "scan.bt").read_bytes()[:-200])
    with pytest.raises(InputError, match=r"cut\.bt"):
        nmm.VoxelMap.load(tmp_path / "cut.bt")
    (tmp_path / "no.bt").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"no\.bt"):
        nmm.VoxelMap.load(tmp_path / "no.bt")


def test_heights_are_columns_to_the_last_millimetre() -> None:
    heights = np.random.default_rng(5).uniform(0.0, 0.5, (12, 9))
    heights[3, 4] = np.nan
    ground = nmm.ElevationMap(heights, 0.1, [1.0, 2.0, 0.2])
    elements = ground.shape
    assert elements.halves is not None  # type: ignore[attr-defined]  # of its elements
    tops = np.full(heights.shape, -np.inf)
    index = np.floor((elements.centres[:, :2] - [1.0, 2.0]) / 0.1 + 1e-9).astype(int)  # type: ignore[attr-defined]
    np.maximum.at(tops, tuple(index.T), elements.centres[:, 2] + elements.halves[:, 2])  # type: ignore[attr-defined]
    known = np.isfinite(heights)
    assert np.allclose(tops[known], heights[known] + 0.2, atol=1e-12)
    assert not np.isfinite(tops[~known]).any()


def test_cells_of_the_surface_are_those_beside_one_that_is_not_full() -> None:
    full = np.random.default_rng(6).uniform(size=(7, 8, 9)) < 0.8
    padded = np.pad(full, 1)
    for i, j, k in np.ndindex(*full.shape):
        beside = [
            padded[i, j + 1, k + 1], padded[i + 2, j + 1, k + 1], padded[i + 1, j, k + 1],
            padded[i + 1, j + 2, k + 1], padded[i + 1, j + 1, k], padded[i + 1, j + 1, k + 2],
        ]  # fmt: skip
        assert surface(full)[i, j, k] == (full[i, j, k] and not all(beside))


def test_heights_of_a_file(tmp_path):
    file = tmp_path / "ramp.npz"
    heights = np.arange(12.0).reshape(3, 4) / 20.0
    np.savez(file, heights=heights, resolution=0.1, origin=[1.0, 2.0, 0.2])
    ground = nmm.ElevationMap.load(file)
    assert ground.name == "ramp"
    np.testing.assert_array_equal(ground.heights, heights)
    np.testing.assert_array_equal(ground.origin, [1.0, 2.0, 0.2])
    np.savez(file, heights=heights)
    with pytest.raises(nmm.InputError, match=r"ramp\.npz: expected the array resolution.*heights"):
        nmm.ElevationMap.load(file)
    np.savez(file, heights=heights, resolution=[0.1, 0.1])
    with pytest.raises(nmm.InputError, match="resolution"):
        nmm.ElevationMap.load(file)
    file.write_bytes(b"PK nothing")
    with pytest.raises(nmm.InputError, match=r"ramp\.npz: damaged, or no NPZ"):
        nmm.ElevationMap.load(file)
    with pytest.raises(nmm.InputError, match=r"expected a \.npz file"):
        nmm.ElevationMap.load("ramp.tif")
    with pytest.raises(nmm.InputError, match=r"gone\.npz: cannot be read"):
        nmm.ElevationMap.load(tmp_path / "gone.npz")
