"""`nmm drive` in a real browser: the target is dragged, and the robot follows as Pinocchio says."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from driven_pages import driven, opened
from legend_rows import lines_with_rows
from playback_browser import UPRIGHT, WALK, Window, draw_frames, watched
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playwright.sync_api import Browser, Page
from ports import MOST

import nmm
from nmm.base.resolver_style import resolver_styles
from nmm.model.robots.configuration import Configuration
from nmm.plugins.live.driving import RobotSetup, ScenarioSetup
from nmm.plugins.live.driving.driven import Driven

#: Where a point of a gizmo is in the window, px: its ball, or the tip of the arrow along an axis.
WHERE = """([target, way, length]) => {
  const { group, place } = nmm.gizmos.all[target];
  const at = place.clone();
  if (way) at[way] += length;
  const p = new MeshCat.THREE.Vector3(at.x, at.z, -at.y).project(viewer.camera);
  const box = document.getElementById("view").getBoundingClientRect();
  return [box.left + (0.5 + 0.5 * p.x) * box.width, box.top + (0.5 - 0.5 * p.y) * box.height];
}"""
ERROR = "nmm.state().runs[0].values.error_norm"
#: What a first plan may take, ms: on a busy machine without a cache it is compiled for more than a minute.
FIRST_PLAN = 10_000.0 * MOST


@pytest.fixture(scope="module")
def setup() -> ScenarioSetup:
    return ScenarioSetup(nmm.Scenario.load("unicycle_3r_position"))


def target(page: Page) -> np.ndarray:
    return np.array(page.evaluate("nmm.drive.targets[0].value"))


def place(page: Page, target: int, way: str, length: float) -> list[float]:
    """Where a point of a gizmo is on the screen, and stays: a camera that follows would go on."""
    if page.locator("#follow").get_attribute("aria-pressed") == "true":
        page.locator("#follow").click()
    found: list[float] = page.evaluate(WHERE, [target, way, length])
    return found


def drag(page: Page, start: list[float], by: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(start[0] + by[0], start[1] + by[1], steps=4)
    page.mouse.up()


def arrived(page: Page) -> None:
    """The error falls by e each second, or faster with a larger gain.

    First the program must know what has been aimed at: until then the error is that of the target before.
    """
    page.wait_for_function("nmm.drive.targets[0].awaited === undefined", timeout=1000.0 * MOST)
    page.wait_for_function(f"{ERROR} < 2e-3", timeout=1000.0 * MOST)


def test_the_end_effector_arrives_where_the_ball_is_dragged(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.get_by_label("K of ee").fill("2.9")  # the logarithm: of 18 1/s
        page.get_by_label("K of ee").dispatch_event("change")
        arrived(page)
        before = target(page)
        page.evaluate("nmm.camera.look('top')")
        drag(page, place(page, 0, "", 0.0), (25.0, -20.0))
        after = target(page)
        assert np.abs(after[:2] - before[:2]).min() > 0.05  # in the ground's plane
        assert after[2] == before[2]
        arrived(page)
        # What is drawn is where Pinocchio has it.
        q = page.evaluate("Object.entries(nmm.state().runs[0].values)")
        found = dict(q)
        here = Configuration(setup.robot, np.array([found[name] for name in setup.robot.q_names]))
        np.testing.assert_allclose(here.placement("ee").translation, after, atol=4e-3)
        tree = page.evaluate(WALK)
        path = next(name for name in tree if name.endswith("/theta"))
        drawn = np.array(tree[path]).reshape(4, 4, order="F")
        root = np.linalg.inv(UPRIGHT) @ drawn
        # The picture may be one ahead of the plots.
        np.testing.assert_allclose(root[:2, 3], [found["x"], found["y"]], atol=2e-2)


def test_an_arrow_goes_along_its_axis_and_keys_too(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        before = target(page)
        length = 0.2 * setup.robot.reach
        drag(page, place(page, 0, "z", 0.9 * length), (0.0, -25.0))
        after = target(page)
        np.testing.assert_array_equal(after[:2], before[:2])
        assert after[2] > before[2] + 0.02
        for key, row, sign in (
            ("ArrowRight", 0, 1), ("ArrowLeft", 0, -1), ("ArrowUp", 1, 1), ("ArrowDown", 1, -1),
            ("PageUp", 2, 1), ("PageDown", 2, -1),
        ):  # fmt: skip
            before = target(page)
            page.keyboard.press(key)
            moved = target(page) - before
            assert moved[row] * sign > 0.0
            assert np.count_nonzero(moved) == 1
        box = page.get_by_label("ee: x in m, as a number")
        box.fill("0.25")
        box.press("Enter")
        assert target(page)[0] == 0.25
        box.fill("1e9")  # the program does not listen to that
        box.press("Enter")
        assert target(page)[0] == 0.25
        assert box.evaluate("box => box.validationMessage").startswith("from ")
        box.fill("0.5")
        box.press("Enter")
        assert target(page)[0] == 0.5
        box.press("ArrowUp")  # the box's own key, and nobody else's
        assert target(page)[1] == before[1]


def test_a_target_brought_back_stays_while_old_pictures_arrive(window: Window, setup: ScenarioSetup) -> None:
    """Messages are held back: pictures show where it was before, and in one of them it is where it is now."""
    with driven(setup) as url:
        page = opened(window, url)
        box = page.get_by_label("ee: x in m, as a number")

        def put(x: float) -> None:
            box.fill(str(x))
            box.press("Enter")

        put(0.25)
        page.wait_for_function("nmm.drive.targets[0].awaited === undefined")
        page.evaluate("""() => {
          window.held = { messages: [], shown: [], send: nmm.send };
          nmm.send = (message) => held.messages.push(message);
          const drive = nmm.hooks.drive;
          nmm.hooks.drive = (picture) => {
            drive(picture);
            held.shown.push([picture.targets[0][0], nmm.drive.targets[0].value[0]]);
          };
        }""")
        put(0.5)
        put(0.25)
        shown = "held.shown.some(([program]) => program === {0})"
        page.wait_for_function("held.messages.length === 2")
        page.evaluate("held.shown.length = 0")
        page.wait_for_function(shown.format(0.25))
        page.evaluate("held.send(held.messages[0])")
        page.wait_for_function(shown.format(0.5))
        page.evaluate("held.send(held.messages[1])")
        page.wait_for_function("nmm.drive.targets[0].awaited === undefined")
        assert {mine for _, mine in page.evaluate("held.shown")} == {0.25}


def ball_from(page: Page, at: tuple[float, float]) -> float:
    """How far the first ball is from a point of the window, px."""
    page.evaluate("viewer.scene.updateMatrixWorld(true)")
    return float(np.hypot(*np.subtract(page.evaluate(WHERE, [0, "", 0.0]), at)))


def test_the_ball_stays_under_the_pointer_while_the_robot_drives(
    window: Window, setup: ScenarioSetup
) -> None:
    """For 10 s, of which the robot drives the first ones, with a camera that goes along with it."""
    with driven(setup) as url:
        page = opened(window, url)
        page.set_viewport_size({"width": 1280, "height": 800})
        page.get_by_label("K of ee").fill("2.9")
        page.get_by_label("K of ee").dispatch_event("change")
        arrived(page)
        assert page.evaluate("nmm.camera.following")
        x, y = page.evaluate(WHERE, [0, "", 0.0])
        place = """() => new MeshCat.THREE.Vector3()
          .setFromMatrixPosition(nmm.node(nmm.motions[0].root).matrixWorld).project(viewer.camera).toArray()"""
        robot = page.evaluate(place)
        root = "nmm.node(nmm.motions[0].root).matrixWorld.elements.slice(12, 15)"
        began, before = np.array(page.evaluate(root)), target(page)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 150.0, y + 60.0, steps=6)
        apart, gone, k = [], 0.0, 0
        while k < 20 or (gone < 0.3 and k < 40):  # longer where the machine is busy
            page.wait_for_timeout(500.0)
            at = (x + 150.0 + k, y + 60.0)
            apart.append(ball_from(page, (at[0] - (k > 0), at[1])))
            page.mouse.move(*at)
            apart.append(ball_from(page, at))
            gone = float(np.linalg.norm(np.array(page.evaluate(root)) - began))
            k += 1
        assert gone > 0.3
        assert max(apart) < 2.0, apart
        assert np.linalg.norm(target(page) - before) < 3.0
        # Let go of, the camera catches up: the robot is where it was in the picture.
        assert np.hypot(*np.subtract(page.evaluate(place), robot)[:2]) > 0.05
        page.mouse.up()
        back = f"([x, y]) => {{ const at = ({place})(); return Math.hypot(at[0] - x, at[1] - y) < 0.02; }}"
        page.wait_for_function(back, arg=robot[:2])


#: Where the middle of the robot's base is in the picture, -1 to 1, and where the ball is in the window, px.
LED = """() => {
  viewer.scene.updateMatrixWorld(true);
  viewer.camera.updateMatrixWorld();
  const at = new MeshCat.THREE.Vector3().setFromMatrixPosition(nmm.node(nmm.motions[0].root).matrixWorld);
  return at.project(viewer.camera).toArray().slice(0, 2);
}"""


def test_a_camera_follows_the_robot_that_a_hand_leads(window: Window, setup: ScenarioSetup) -> None:
    """A ball that is held at the picture's edge leads the robot far out of where the picture was, and both
    stay in it; held in the middle the picture stands, and the target with it."""
    with driven(setup) as url:
        page = opened(window, url)
        page.set_viewport_size({"width": 880, "height": 420})
        page.get_by_label("K of ee").fill("2.9")
        page.get_by_label("K of ee").dispatch_event("change")
        arrived(page)
        page.evaluate("nmm.camera.look('top')")
        assert page.evaluate("nmm.camera.following")
        seen = "nmm.viewer.controls.target.toArray()"
        first, before = np.array(page.evaluate(seen)), target(page)
        view = page.locator("#view").bounding_box()
        assert view is not None
        page.mouse.move(*page.evaluate(WHERE, [0, "", 0.0]))
        page.mouse.down()
        edge = view["x"] + 0.9 * view["width"], view["y"] + 0.5 * view["height"]
        page.mouse.move(*edge, steps=6)
        width = 3.0
        page.wait_for_function(f"{seen}[0] > {first[0] + width}", timeout=1000.0 * MOST)  # no hand moves
        assert page.evaluate("nmm.gizmos.held !== null")
        assert target(page)[0] > before[0] + width
        assert ball_from(page, edge) < 2.0
        assert np.abs(page.evaluate(LED)).max() < 0.75
        middle = view["x"] + 0.5 * view["width"], edge[1]
        page.mouse.move(*middle, steps=6)
        arrived(page)
        page.wait_for_timeout(500.0)  # what was under way
        stands, held = np.array(page.evaluate(seen)), target(page)
        page.wait_for_timeout(500.0)
        np.testing.assert_array_equal(page.evaluate(seen), stands)
        np.testing.assert_array_equal(target(page), held)
        assert ball_from(page, middle) < 2.0
        page.mouse.up()
        arrived(page)
        np.testing.assert_allclose(target(page), held, atol=1e-9)  # where it was dropped


def test_a_low_window_has_the_robot_near_enough_to_be_seen(window: Window, setup: ScenarioSetup) -> None:
    far = "nmm.viewer.camera.position.distanceTo(nmm.viewer.controls.target)"
    with driven(setup) as url:
        page = opened(window, url)
        found = []
        for width, height in ((900, 600), (480, 300)):
            page.set_viewport_size({"width": width, "height": height})
            draw_frames(page)
            page.evaluate("nmm.camera.reset()")
            found.append(page.evaluate(far))
        assert found[1] < 2.5 * found[0]
        height = page.evaluate("document.querySelector('#heading h1').clientHeight")
        assert height < 25.0  # one line


def test_the_line_behind_the_hand_is_in_the_legend(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.set_viewport_size({"width": 900, "height": 600})  # low windows leave it out
        entry = page.get_by_role("button", name="the last 30 s of ee")
        shown = "nmm.node('/nmm/trail 0').visible"
        assert entry.get_attribute("aria-pressed") == "true"
        assert page.evaluate(shown)
        entry.click()
        assert not page.evaluate(shown)


def test_a_ring_under_the_hand_moves_no_camera(window: Window, setup: ScenarioSetup) -> None:
    """Its angle would change without the hand; nor does a hand in the middle of the picture."""
    with driven(setup) as url:
        page = opened(window, url)
        arrived(page)
        seen = "nmm.viewer.controls.target.toArray()"
        for hand, moves in (
            ("null", False),
            ("() => ({x: 0.5, y: 0})", False),
            ("() => ({x: 0.9, y: 0})", True),
        ):
            before, after = page.evaluate(f"""() => {{
              nmm.camera.freeze(true, {hand});
              const before = {seen};
              const root = nmm.node(nmm.motions[0].root);
              // To the right in the picture: three.js has y upwards, robots z.
              const right = nmm.viewer.camera.matrixWorld.elements;
              root.position.x += 5 * right[0];
              root.position.y -= 5 * right[2];
              root.matrix.elements[12] += 5 * right[0];
              root.matrix.elements[13] -= 5 * right[2];
              nmm.camera.update();
              const after = {seen};
              nmm.camera.freeze(false);
              return [before, after];
            }}""")
            assert (after != before) is moves


#: Where points of a target's ring are in the window, px: `at` rad about its axis from the next axis on, and
#: `further` times the radius along the tangent there.
ON_RING = """([axis, points]) => {
  const { turned } = nmm.gizmos.all[0];
  const ring = turned.children.find((one) => one.children[0].userData.name === `turn ${"xyz"[axis]}`);
  const { radius } = ring.children[0].geometry.parameters;
  viewer.scene.updateMatrixWorld(true);
  const box = document.getElementById("view").getBoundingClientRect();
  return points.map(([at, further]) => {
    const p = new MeshCat.THREE.Vector3();
    p.setComponent((axis + 1) % 3, radius * (Math.cos(at) - further * Math.sin(at)));
    p.setComponent((axis + 2) % 3, radius * (Math.sin(at) + further * Math.cos(at)));
    turned.localToWorld(p).project(viewer.camera);
    return [box.left + (0.5 + 0.5 * p.x) * box.width, box.top + (0.5 - 0.5 * p.y) * box.height, p.z];
  });
}"""


#: How far a ring is dragged, rad.
TURN = 0.5


def test_a_ring_turns_the_target_by_the_angle_dragged(window: Window) -> None:
    """About each of its own axes, seen from two sides; Pinocchio composes the rotations."""
    robot = nmm.load("unicycle_3r")
    turning = RobotSetup(robot, [nmm.Orientation("ee")], robot.q({"q2": 0.8, "q3": 0.5}))
    with driven(turning) as url:
        page = opened(window, url)
        page.set_viewport_size({"width": 800, "height": 500})
        page.locator("#follow").click()
        page.locator("#pause").click()
        page.wait_for_function("nmm.drive.paused")

        def on_ring(axis: int, at: Any, further: Any = 0.0) -> np.ndarray:
            given = np.stack(np.broadcast_arrays(at, further), axis=-1).tolist()
            return np.array(page.evaluate(ON_RING, [axis, given]))

        def is_hit(axis: int, x: float, y: float) -> bool:
            """Whether nothing else is before it."""
            page.mouse.move(x, y)
            return bool(page.evaluate("nmm.gizmos.bright") == f"0 turn {'xyz'[axis]}")

        sides: list[bool] = []
        for side in ("iso", "top"):
            page.evaluate(f"nmm.camera.look('{side}')")
            draw_frames(page)
            for axis in range(3):
                tried = np.arange(0.3, 6.0, 0.25)
                at = next(at for at in tried if is_hit(axis, *on_ring(axis, [at])[0, :2]))
                x, y = on_ring(axis, [at])[0, :2]
                before, steps = pin.exp3(target(page)), np.linspace(0.1, TURN, 5)
                arc = on_ring(axis, at + steps)
                front = 0.1 * on_ring(axis, np.arange(0.0, 6.3, 0.1))[:, 2].argmin()  # nearest to the eye
                line = on_ring(axis, front, np.array([0.0, *steps]))
                page.mouse.down()
                sides.append(page.evaluate("nmm.gizmos.held.side"))
                for one in [x, y] + (line[1:] - line[0])[:, :2] if sides[-1] else arc[:, :2]:
                    page.mouse.move(*one)
                page.mouse.up()
                turned = pin.log3(before.T @ pin.exp3(target(page)))
                np.testing.assert_allclose(turned, TURN * np.eye(3)[axis], atol=0.03)
        assert set(sides) == {False, True}


def test_what_is_chosen_changes_the_controller(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        kinds = page.locator('select[data-key="resolver.kind"]')
        assert kinds.input_value() == "rg"
        assert page.evaluate("nmm.camera.following")
        assert page.locator("#follow").get_attribute("aria-pressed") == "true"
        assert page.evaluate("nmm.runs[0].color") == resolver_styles()["rg"][0]
        kinds.select_option("pg")
        page.wait_for_function(f"nmm.runs[0].color === '{resolver_styles()['pg'][0]}'")
        page.locator('input[data-key="limits"]').check()
        page.wait_for_function("document.getElementById('told').textContent.match(/^t = [\\d.]+ s/)")
        page.evaluate("document.activeElement.blur()")  # the space bar is the check box's own
        page.keyboard.press("Space")
        page.wait_for_function("nmm.drive.paused")
        t = page.evaluate("nmm.drive.time")
        page.wait_for_timeout(200)
        assert page.evaluate("nmm.drive.time") == t
        page.get_by_role("button", name="Begin again").click()
        page.wait_for_function("nmm.drive.time === 0")
        page.get_by_role("button", name="Go on").click()
        page.wait_for_function("nmm.drive.time > 0.1")
        # The second choice is made when the first has been, which on a busy machine takes its time.
        page.wait_for_function("""document.querySelector('input[data-key="limits"]').checked""")
        assert kinds.input_value() == "pg"


def test_n_plans_round_a_wall_and_the_page_shows_how(window: Window) -> None:
    """Paths and copies are there while the robot follows; a target that is dragged is planned to again."""
    with driven(ScenarioSetup(nmm.Scenario.load("behind_the_wall"))) as url:
        page = opened(window, url)
        page.keyboard.press("n")
        page.wait_for_function("nmm.drive.followed >= 1", timeout=FIRST_PLAN)
        drawn = "nmm.node('/nmm/plan').children.length"
        assert page.evaluate(drawn) == 4  # two ways, the tree, and the copies
        tree = "nmm.node('/nmm/plan/tree')"
        points = np.array(page.evaluate(f"[...{tree}.children[0].geometry.attributes.position.array]"))
        points = points.reshape(-1, 2, 3)
        assert len(points) > 2
        assert np.linalg.norm(np.diff(points, axis=1), axis=-1).max() <= 2.0 + 1e-6  # a step: 2 s, 1 m/s
        key = page.locator("#legend button", has_text="search tree")  # not seen in a low window
        for shown in (False, True):
            key.dispatch_event("click")
            assert page.evaluate(f"{tree}.visible") is shown
        assert lines_with_rows(page) == ["ground", "plan/0", "plan/1", "plan/tree", "trail 0"]
        button = page.get_by_role("button", name="Plan", exact=True)
        page.wait_for_function("document.getElementById('plan').ariaPressed === 'true'")
        began = np.array(page.evaluate("nmm.drive.targets[0].at"))
        page.wait_for_function("document.getElementById('told').textContent.includes('follows its plan')")
        gone = "([x, y]) => Math.hypot(nmm.drive.targets[0].at[0] - x, nmm.drive.targets[0].at[1] - y) > 0.3"
        page.wait_for_function(gone, arg=began.tolist(), timeout=1000.0 * MOST)
        page.keyboard.press("r")
        start = place(page, 0, "", 0.0)
        before, followed = target(page), page.evaluate("nmm.drive.followed")
        drag(page, start, (-40.0, 20.0))
        assert np.linalg.norm(target(page) - before) > 0.05
        page.wait_for_function(f"nmm.drive.followed > {followed}", timeout=FIRST_PLAN)
        height = page.get_by_label("ee: z in m, as a number")
        height.fill("3")
        height.press("Enter")
        page.wait_for_function(
            "document.getElementById('told').classList.contains('bad')", timeout=1000.0 * MOST
        )
        assert "No plan" in page.locator("#told").inner_text()
        assert page.evaluate(drawn) == 0
        page.set_viewport_size({"width": 420, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 420
        assert page.evaluate("document.getElementById('plan').getBoundingClientRect().right") <= 420
        button.click()
        page.wait_for_function("!nmm.drive.plans")


def test_a_second_page_shows_and_moves_the_same_robot(
    browser: Browser, window: Window, setup: ScenarioSetup
) -> None:
    with driven(setup) as url:
        first = opened(window, url)
        first.locator('select[data-key="resolver.kind"]').select_option("pg")
        page = browser.new_page()
        with watched(page) as other:
            second = opened(other, url)
            second.wait_for_function("document.querySelector('select[data-key]').value === 'pg'")
            second.keyboard.press("ArrowRight")
            place = target(second)[0]
            first.wait_for_function(f"Math.abs(nmm.drive.targets[0].value[0] - {place}) < 1e-12")
            # It came late, and has the curves from before.
            assert second.evaluate("nmm.runs[0].t[0]") <= first.evaluate("nmm.runs[0].t[0]") + 1e-9
        page.close()
        t = first.evaluate("nmm.drive.time")
        first.wait_for_function(f"nmm.drive.time > {t}")


def test_nothing_seeks_and_nothing_is_cut_off_at_420_px(window: Window, setup: ScenarioSetup) -> None:
    """The target, several reaches away from the robot, among it."""
    q = np.array(setup.q0)
    q[setup.robot.coordinate("x")] -= 3.0
    away = ScenarioSetup(setup.scenario, q)
    with driven(away) as url:
        page = opened(window, url)
        page.set_viewport_size({"width": 420, "height": 800})
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= 420
        outside = page.evaluate(
            """() => [...document.querySelectorAll("#drive :is(button, input, select, output, legend)")]
              .filter((part) => part.offsetParent && part.getBoundingClientRect().right > 421)
              .map((part) => part.outerHTML)"""
        )
        assert outside == []
        for side in ("iso", "top"):
            page.evaluate(f"nmm.camera.look('{side}')")
            x, y = page.evaluate(WHERE, [0, "", 0.0])  # the ball
            view = page.evaluate("document.getElementById('view').getBoundingClientRect().toJSON()")
            assert view["left"] < x < view["right"]
            assert view["top"] < y < view["bottom"]
        page.evaluate("nmm.seek(0)")
        t = page.evaluate("nmm.drive.time")
        page.wait_for_function(f"nmm.drive.time > {t}")
        unnamed = page.evaluate(
            """() => [...document.querySelectorAll("#drive :is(input, select)")]
              .filter((part) => !part.labels.length && !part.ariaLabel).map((part) => part.outerHTML)"""
        )
        assert unnamed == []


def test_a_target_out_of_reach_is_said_in_words_and_taken_back(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        told = page.locator("#told")
        height = page.get_by_label("ee: z in m, as a number")
        height.fill("2.5")
        height.press("Enter")
        page.wait_for_function(
            "document.getElementById('told').classList.contains('bad')", timeout=1000.0 * MOST
        )
        assert "The target of ee is out of reach: it is" in told.inner_text()
        assert "links add up to" in told.inner_text()
        height.fill("0.6")
        height.press("Enter")
        page.wait_for_function(
            "!document.getElementById('told').classList.contains('bad')", timeout=1000.0 * MOST
        )
        assert told.inner_text().startswith("t = ")


#: Directions of a target far away, rad, whose arrow would cover tools or heading.
COVERED = """() => {
  const target = { heading: "far", gizmo: { place: { x: 0, y: 0, z: 0 } } };
  const over = (a, b) => a.left < b.right && a.right > b.left && a.top < b.bottom && a.bottom > b.top;
  const cards = ["tools", "heading"].map((id) => document.getElementById(id).getBoundingClientRect());
  const covered = [];
  for (let angle = 0; angle < 6.28; angle += 0.05) {
    Object.assign(target.gizmo.place, { x: 40 * Math.cos(angle), y: 40 * Math.sin(angle) });
    nmm.border.update([target]);
    const arrow = [...document.querySelectorAll(".away")].at(-1);
    if (cards.some((card) => card.width && over(arrow.getBoundingClientRect(), card))) covered.push(angle);
  }
  [...document.querySelectorAll(".away")].at(-1).remove();
  return covered;
}"""


def test_a_target_out_of_the_picture_has_an_arrow_and_comes_back(
    window: Window, setup: ScenarioSetup
) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        page.locator("#pause").click()  # else the robot would go there
        page.wait_for_function("nmm.drive.paused")
        page.set_viewport_size({"width": 1280, "height": 800})
        draw_frames(page)
        arrow = page.locator(".away")
        assert not arrow.is_visible()
        box = page.get_by_label("ee: x in m, as a number")
        for x in ("40", "-40"):
            box.fill(x)
            box.press("Enter")
            arrow.wait_for(state="visible")
            draw_frames(page)
            view = page.evaluate("document.getElementById('view').getBoundingClientRect().toJSON()")
            at = arrow.bounding_box()
            assert at is not None
            assert view["left"] <= at["x"] <= view["right"] - at["width"]
            assert view["top"] <= at["y"] <= view["bottom"] - at["height"]
            assert (at["x"] + 0.5 * at["width"] > 0.5 * view["right"]) is (x == "40")
        # Wherever it points, it covers nothing that one presses.
        assert page.evaluate(COVERED) == []
        arrow.click()
        arrow.wait_for(state="hidden")
        page.keyboard.press("t")
        page.wait_for_function("Math.abs(nmm.drive.targets[0].value[0] - nmm.drive.targets[0].at[0]) < 1e-9")


def test_a_program_that_has_ended_is_seen_and_its_controls_are_dead(
    window: Window, setup: ScenarioSetup
) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        ball = place(page, 0, "", 0.0)
    page.wait_for_function("nmm.ended")
    seen = """() => {
      const { left, top, width, height } = document.getElementById("status").getBoundingClientRect();
      return document.elementFromPoint(left + 0.5 * width, top + 0.5 * height).id;
    }"""
    assert page.evaluate(seen) == "status"
    before = target(page)
    drag(page, ball, (30.0, 10.0))
    page.keyboard.press("ArrowRight")
    np.testing.assert_array_equal(target(page), before)
    assert page.evaluate("document.getElementById('drive').inert")


#: How long after the last picture the page says that none comes, ms, and how late its clock was meanwhile.
WATCH = """() => {
  const inner = nmm.hooks.drive;
  let [last, late, beat] = [performance.now(), 0, performance.now()]; // they come thirty a second
  nmm.hooks.drive = (picture) => {
    [last, late] = [performance.now(), 0];
    inner(picture);
  };
  setInterval(() => {
    const now = performance.now();
    late += Math.max(0, now - beat - 20);
    beat = now;
    const dead = document.getElementById("plan").inert;
    if (dead && window.noticed === undefined) window.noticed = [now - last, late];
  }, 20);
}"""


def test_a_robot_that_does_not_answer_is_seen_and_begins_again(
    window: Window, setup: ScenarioSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    going = threading.Event()
    going.set()
    step = Driven.step
    monkeypatch.setattr(Driven, "step", lambda driven: going.wait() and step(driven))
    with driven(setup) as url:
        try:
            page = opened(window, url)
            page.wait_for_function("nmm.drive.time > 0.5")
            page.evaluate(WATCH)
            going.clear()
            page.wait_for_function("window.noticed !== undefined", timeout=1000.0 * MOST)
            apart, late = page.evaluate("window.noticed")
            assert apart < 1000.0 + late
            told = page.locator("#told")
            assert "does not answer" in told.inner_text()
            assert "bad" in str(told.get_attribute("class"))
            dead = "id => document.getElementById(id).closest('[inert]') !== null"
            assert all(page.evaluate(dead, name) for name in ("pause", "plan", "choices"))
            page.wait_for_function("nmm.silent", timeout=1000.0 * MOST)
            before, stood = target(page), page.evaluate("nmm.drive.time")
            drag(page, place(page, 0, "", 0.0), (30.0, 10.0))
            page.keyboard.press("ArrowRight")
            np.testing.assert_array_equal(target(page), before)
            page.locator("#again").click()
        finally:
            going.set()
        page.wait_for_function("!nmm.silent && !document.getElementById('told').classList.contains('bad')")
        page.wait_for_function(f"0 < nmm.drive.time && nmm.drive.time < {stood}", timeout=1000.0 * MOST)
        assert not page.evaluate(dead, "plan")
        page.keyboard.press("ArrowRight")
        assert target(page)[0] > before[0]


def test_a_plan_where_the_robot_is_ends_and_the_page_lives(window: Window, setup: ScenarioSetup) -> None:
    with driven(setup) as url:
        page = opened(window, url)
        arrived(page)
        page.keyboard.press("t")
        page.locator("#plan").click()
        page.wait_for_function(
            "document.getElementById('told').textContent.includes(\"plan's end\")", timeout=FIRST_PLAN
        )
        page.locator("#plan").click()
        time = page.evaluate("nmm.drive.time")
        page.locator("#again").click()
        page.wait_for_function(f"nmm.drive.time < {time}", timeout=1000.0 * MOST)
        assert not page.evaluate("nmm.silent")


def test_pictures_come_at_their_rate(window: Window, setup: ScenarioSetup) -> None:
    """Thirty a second of the robot's time; a busy machine may send them late, and in crowds."""
    with driven(setup) as url:
        page = opened(window, url)
        times = page.evaluate(
            """() => new Promise((done) => {
              const hook = nmm.hooks.drive;
              const times = [];
              nmm.hooks.drive = (picture) => {
                times.push(...picture.samples.map(([t]) => t));
                hook(picture);
              };
              setTimeout(() => done(times), 2000);
            })"""
        )
    assert len(times) >= 5
    assert np.all(np.diff(times) > 0.0)
    assert len(times) - 1 <= 32.0 * (times[-1] - times[0]) + 1.0
