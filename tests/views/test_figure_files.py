"""Figures as files: formats, widths, text that is text; times beside robots; the plane of the motion."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from figure_examples import check_legible, run
from matplotlib.figure import Figure

import nmm
from nmm import figures
from nmm.base.bundled import bundled_scenarios
from nmm.base.errors import InputError
from nmm.base.figure_options import WIDTHS, FigureOptions
from nmm.cli.exit_status import status_of
from nmm.scenario import Scenario
from nmm.views.figures.composed import write_run_figures
from nmm.views.figures.motion import MotionScene
from nmm.views.figures.silhouette import hull
from nmm.views.figures.time_labels import Place
from nmm.views.figures.views import ABOVE, SIDE, upright

ONE = "unicycle_2r_position"
#: Pixels of text nearer to white than this are its own blur.
WHITE = 250


#: Another robot, path or view each; the others are drawn alike.
TIMED = ("car_parks", "tiago_pointing", "two_arms_box", ONE, "unicycle_3r_crossing")


@pytest.mark.parametrize(
    ("k", "name"),
    [
        pytest.param(k, name, marks=() if name in TIMED else pytest.mark.thorough)
        for k, name in enumerate(sorted(bundled_scenarios()))
    ],
)
def test_times_touch_nothing(k: int, name: str) -> None:
    """Where a time stands there is white below it, in wide figures and narrow ones, and it belongs to a robot
    beside it."""
    width = (WIDTHS["column"], 5.2)[k % 2]
    trajectory = Scenario.load(name).run()
    scene = MotionScene(trajectory)
    made = figures.stroboscopic(trajectory, width=width)
    axes = made.axes[0]
    axes.grid(False)
    made.canvas.draw()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) >= len(scene.poses)
    for text in axes.texts:
        text.set_visible(False)
    made.canvas.draw()
    drawn = np.asarray(made.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]  # Agg's
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])
        rows = slice(len(drawn) - int(np.ceil(box.y1)), len(drawn) - int(box.y0))
        assert drawn[rows, int(box.x0) : int(np.ceil(box.x1))].min() > WHITE
    # Beside its robot, or with a line that leads there.
    places = scene.times_at(ABOVE, axes.get_window_extent().width / made.dpi)
    scale = np.ptp(axes.get_xlim()) / axes.get_window_extent().width * made.dpi
    bodies = [hull(pose.main[:, :2]) for pose in scene.poses]
    for k, place in enumerate(places[: len(bodies)]):
        gaps = [_gap(place, body) for body in bodies]
        # Nearer to it than to any other, clearly; outlines are sampled every tenth of an inch.
        others = min((*gaps[:k], *gaps[k + 1 :]), default=np.inf)
        assert place.foot is not None or (gaps[k] <= 0.2 * scale and gaps[k] + 0.03 * scale <= others)


def _gap(place: Place, outline: np.ndarray) -> float:
    """How far a text is from an outline (k, 2), m."""
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    points = (outline + shares * (np.roll(outline, -1, axis=0) - outline)).reshape(-1, 2)
    away = np.maximum(np.abs(points - place.middle) - place.half, 0.0)
    return float(np.linalg.norm(away, axis=1).min())


@pytest.mark.parametrize(
    ("name", "width"),
    [
        (ONE, WIDTHS["column"]),
        ("unicycle_3r_crossing", WIDTHS["page"]),
        pytest.param("unicycle_3r_crossing", WIDTHS["column"], marks=pytest.mark.thorough),
        pytest.param("unicycle_3r_crossing", 5.0, marks=pytest.mark.thorough),
    ],
)
def test_figures_of_any_width_are_legible(name: str, width: float) -> None:
    trajectory = run(name)
    drawings = [
        figures.stroboscopic, figures.errors, figures.tracking, figures.inputs, figures.coordinates,
        figures.singular_values, figures.overview,
    ]  # fmt: skip
    made = [draw(trajectory, width=width) for draw in drawings]
    pair = [trajectory, run(name, "pg")]
    made += [figures.comparison(pair, width=width), figures.objective_comparison(pair, width=width)]
    if name != ONE:
        made.append(figures.clearance(trajectory, width=width))
    for one in made:
        assert one.get_size_inches()[0] == width
        check_legible(one)


def test_labels_of_panels_above_each_other_are_aligned() -> None:
    made = figures.overview(run("unicycle_3r_position"))
    made.canvas.draw()
    edges: dict[float, list[float]] = {}
    for axes in made.axes:
        if axes.get_ylabel():
            edges.setdefault(round(axes.get_position().x0, 6), []).append(
                axes.yaxis.label.get_window_extent().x1
            )
    assert max(len(found) for found in edges.values()) >= 4
    for found in edges.values():
        np.testing.assert_allclose(found, found[0], atol=1.0)  # a pixel


def test_a_curve_below_another_is_seen_where_they_coincide() -> None:
    trajectory = run(ONE)
    made = figures.objective_comparison([trajectory, trajectory])
    below, above = made.axes[0].lines[:2]
    np.testing.assert_array_equal(below.get_xydata(), above.get_xydata())
    assert below.get_linewidth() > above.get_linewidth() + 0.5
    assert below.get_color() != above.get_color()


def written(made: Figure, path: Path) -> bytes:
    return figures.save(made, path).read_bytes()


def test_vector_files_hold_text_and_whole_fonts(tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    svg = written(figures.errors(run(ONE)), tmp_path / "a.svg").decode()
    pdf = written(figures.errors(run(ONE)), tmp_path / "a.pdf")
    assert dict(matplotlib.rcParams) == before
    assert re.search(r"<text[^>]*>[^<]*time t \[s\]", svg)
    assert "<image" not in svg
    assert not re.search(r'(href|src)="[^#]', svg.split("</metadata>")[1])
    assert pdf.startswith(b"%PDF")
    assert b"/Type3" not in pdf
    assert b"/TrueType" in pdf or b"/CIDFontType2" in pdf
    assert b"/Subtype /Image" not in pdf
    # As wide as it was asked to be, in points, and the same file each time.
    column = written(figures.errors(run(ONE), width=3.5), tmp_path / "b.pdf")
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", column)
    assert box is not None
    assert float(box[1]) == pytest.approx(3.5 * 72.0)
    for kind in ("pdf", "svg", "png"):
        first, second = (written(figures.errors(run(ONE)), tmp_path / f"{k}.{kind}") for k in range(2))
        assert first == second
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL)
    assert any(b" Tf" in zlib.decompress(stream) for stream in streams if stream.startswith(b"x"))


def test_run_figures_in_several_formats(tmp_path: Path) -> None:
    options = FigureOptions(("pdf", "svg"), "column")
    found = write_run_figures(run(ONE), tmp_path, options=options)
    names = {
        f"{name}.{kind}" for name in ("motion", "errors", "inputs", "objective") for kind in ("pdf", "svg")
    }
    assert {path.name for path in found} == names == {path.name for path in tmp_path.iterdir()}
    saved = run(ONE).save(tmp_path / "run", figures=FigureOptions(("svg",), "column"))
    assert {path.suffix for path in saved.iterdir()} & {".png", ".pdf", ".svg"} == {".svg"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"formats": ("jpg",)}, {"formats": "png"}, {"formats": ()}, {"width": "wide"}, {"width": 0.5},
        {"width": float("nan")}, {"width": True}, {"width": 1e9},
    ],
)  # fmt: skip
def test_options_that_cannot_be(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"figures: expected .*, got "):
        FigureOptions(**wrong)  # type: ignore[arg-type]  # that is what is tried


def test_files_that_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ends in \.png, \.pdf or \.svg"):
        figures.save(Figure(), tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"no/a\.png: cannot be written: No such file"):
        figures.save(Figure(), tmp_path / "no" / "a.png")
    with pytest.raises(InputError, match="expected True, False or FigureOptions"):
        run(ONE).save(tmp_path / "run", figures="pdf")  # type: ignore[arg-type]  # that is what is tried


def test_views_above_each_other_have_the_same_x() -> None:
    above, side = figures.stroboscopic(run("unicycle_3r_position")).axes
    assert (above.get_xlabel(), side.get_xlabel()) == ("x [m]", "x [m]")
    assert above.get_xlim() == side.get_xlim()


def test_the_side_view_shows_the_plane_of_the_motion() -> None:
    """A path in an upright plane keeps its length there, whichever way the plane is turned."""
    s = np.linspace(0.0, 2.0, 50)
    for degrees in range(-90, 91, 5):
        a = np.radians(degrees)
        path = np.column_stack([1.0 + s * np.cos(a), 3.0 + s * np.sin(a), np.sin(s)])
        view = upright(path)
        seen = view.of(path)
        length = np.linalg.norm(np.diff(seen, axis=0), axis=1).sum()
        true = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert length >= np.cos(np.radians(15.0)) * true
        if 15 < abs(degrees) < 75:
            assert length == pytest.approx(true)
            assert f"{abs(degrees)}°" in view.labels[0]
        assert view.up == (0.0, 0.0, 1.0)
        np.testing.assert_allclose(view.rows @ view.rows.T, np.eye(2), atol=1e-12)
        assert view.across[0] >= -1e-12
    assert upright(path).labels == ("y [m]", "z [m]")
    circle = np.column_stack([np.cos(3.0 * s), np.sin(3.0 * s), s])
    for other in (circle, path[:1], path[:, [2, 2, 2]] * [0.0, 0.0, 1.0], np.full((4, 3), np.nan)):
        assert upright(other) == SIDE


#: Names that matplotlib would read as formulas, and cannot.
DOLLARS = """<robot name="a$b^$"><link name="base"/><link name="upper"/><link name="tip$x^$"/>
<joint name="q$1^{$" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0.1 0 0.3"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="q$\\frac$2" type="revolute"><parent link="upper"/><child link="tip$x^$"/><origin xyz="0.3 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_names_with_dollar_signs_stand_as_they_are(tmp_path: Path) -> None:
    file = tmp_path / "r.urdf"
    file.write_text(DOLLARS, encoding="utf-8")
    robot = nmm.load(file, platform="unicycle", wheels=[])
    task = nmm.Task(nmm.Position("tip$x^$", "xy"), [1.0, 0.5])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=nmm.Limits())
    run = nmm.simulate(controller, robot.rest, 0.1, 0.01)
    written = run.save(tmp_path / "run", figures=FigureOptions(("svg",)))
    texts = "".join(figure.read_text(encoding="utf-8") for figure in written.glob("*.svg"))
    for name in ("q$1^{$", "q$\\frac$2", "tip$x^$"):
        assert name in texts
    drawn = ["map", str(file), "--platform", "unicycle", "--wheels", "none", "--task", "position:tip$x^$:xy"]
    drawn += ["--over", "q$1^{$,theta", "--out", str(tmp_path / "map"), "--format", "svg"]
    drawn += ["--at", "q$\\frac$2=0.5", "--measure", "weighted"]
    assert status_of(drawn) == 0
    (figure,) = (tmp_path / "map").glob("*.svg")
    text = figure.read_text(encoding="utf-8")
    assert "q$1^{$" in text
    assert "q$\\frac$2 = 0.5" in text
