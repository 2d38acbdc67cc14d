"""First scenarios: `nmm init` for bundled robots and other people's, and what it refuses."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import Result
from findings import refused
from PIL import Image
from places import DATA
from small_pictures import draw_only
from urdf_parts import joint, link, robot, shape, write

import nmm
from nmm.base.bundled import bundled_robots
from nmm.cli.exit_status import status_of
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.packages import package_file
from nmm.scenario.scaffold.end_effector import hands
from nmm.views.figures.style import figure, save
from nmm.views.folders.run import is_run

Command = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process."""
    draw_only([], monkeypatch)
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


def started(run: Command, *arguments: str) -> nmm.Trajectory:
    """What `nmm init` writes is run as it stands, by the command line: here its run."""
    made = run("init", *arguments, "--out", "first.yaml")
    assert (made.status, made.err) == (0, "")
    done = run("run", "first.yaml", "--out", "out")
    assert done.status == 0, done.err
    assert is_run(Path("out"))
    trajectory = nmm.Trajectory.load("out")
    assert trajectory.outcome == "completed"
    return trajectory


#: Robots of others: what is led, whether the file's own base is kept.
OTHERS = {
    "ur_description/urdf/ur5_robot.urdf": ("ee_link", False),
    "panda_description/urdf/panda.urdf": ("panda_hand_tcp", False),
    "kinova_description/robots/kinova.urdf": ("j2s6s200_end_effector", False),
    "a1_description/urdf/a1.urdf": ("FL_foot", False),
    "tiago_description/robots/tiago_no_hand.urdf": ("wrist_ft_tool_link", True),
}


#: Robots like others of these.
ALIKE = ("unicycle_3r", "differential_base", "ur_description/urdf/ur5_robot.urdf")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.thorough if name in ALIKE else ())
        for name in (*bundled_robots(), *OTHERS)
    ],
)
def test_it_runs_as_it_is_written(run: Command, name: str) -> None:
    frame, own_base = OTHERS.get(name, ("", True))
    trajectory = started(run, f"{DATA}{name}" if frame else name)
    scenario = nmm.Scenario.load("first.yaml")
    given = scenario.document.data
    loaded = scenario.robot()
    q0 = loaded.q(scenario.parts.q0)
    loaded.check_limits(q0)
    assert np.ptp(trajectory.q[:, :2], axis=0).max() > 0.2  # the platform drives
    limits = scenario.parts.limits.build(loaded).on(loaded)
    assert np.isfinite(limits.accelerations).all()
    usual = np.where(np.isfinite(loaded.u_limits), loaded.u_limits, limits.inputs[:, 1])
    np.testing.assert_array_equal(limits.inputs[:, 1], usual)  # those of the file are kept
    change = np.abs(np.diff(trajectory.u, axis=0, prepend=np.zeros((1, loaded.n_u))))  # from rest on
    assert (change <= limits.accelerations * 0.01 * (1.0 + 1e-9)).all()
    assert not any(one.code == "tips" for one in trajectory.torques().findings)
    if frame:
        assert given["task"]["frame"].endswith(frame)
        assert isinstance(given["robot"], str) is own_base
    # The hand begins where the path does.
    place = Configuration(loaded, q0).placement(given["task"]["frame"]).translation
    rows = ["xyz".index(axis) for axis in given["task"]["axes"]]
    np.testing.assert_allclose(trajectory.r_d[0], place[rows], atol=1e-4)
    # Nor is it near a singularity, by J from differences.
    assert trajectory.sigma_min[0] > 0.02 * loaded.reach


#: The files of example-robot-data for which there is none, and why.
WITHOUT = {
    "ur3.urdf": "<robot> has no name; no links",  # the file's own mistake
    "quadrotor_base.urdf": "neither wheels nor movable joints",
    "iris_simple.urdf": "neither wheels nor movable joints",
}


#: A few, each of another kind: legs, an arm on legs, a hand, an arm, one that flies, hardly anything.
SOME = {
    "solo12.urdf", "anymal-kinova.urdf", "allegro_left_hand.urdf", "talos_left_arm.urdf",
    "borinot_flying_arm_2.urdf", "double_pendulum_simple.urdf", *WITHOUT,
}  # fmt: skip


@pytest.mark.parametrize("some", [True, pytest.param(False, marks=pytest.mark.thorough)], ids=["some", "all"])
def test_files_of_example_robot_data_have_one_that_runs(some: bool) -> None:
    """What loads is led along a path as its gain promises, or is refused with the reason."""
    folder = package_file(DATA + "ur_description/urdf/ur5_robot.urdf").parents[2]
    files = sorted(folder.glob("*/*/*.urdf"))
    assert len(files) > 60
    if some:
        files = [file for file in files if file.name in SOME]
        assert {file.name for file in files} == SOME
    refused = {}
    for file in files:
        try:
            draft = nmm.first_scenario(file)
        except nmm.InputError as error:
            refused[file.name] = str(error)
            continue
        run = draft.trajectory
        assert run.outcome == "completed", file
        assert np.abs(run.error).max() < 2e-3, file  # m: the path begins where the hand is
        assert run.scale.min() > 0.99, file
        assert np.ptp(run.r, axis=0).max() > 0.1 * min(run.robot.reach, 1.0), file
        run.robot.check_limits(run.q[0])
    assert refused.keys() == WITHOUT.keys()
    for name, reason in WITHOUT.items():
        assert reason in refused[name]


def test_every_key_has_its_words(run: Command) -> None:
    started(run, "unicycle_3r")
    lines = Path("first.yaml").read_text(encoding="utf-8").splitlines()
    keys = [i for i, line in enumerate(lines) if line[:1].isalpha()]
    assert {lines[i].split(":")[0] for i in keys} == {
        "title", "robot", "q0", "duration", "dt", "task", "objective", "resolver", "limits",
    }  # fmt: skip
    assert all(lines[i - 1].startswith("# ") for i in keys)
    assert max(map(len, lines)) <= 116
    said = " ".join(line.removeprefix("# ") for line in lines if line.startswith("#"))
    kinds = (
        *nmm.base.kinds.TASKS,
        *nmm.base.kinds.REFERENCES,
        *nmm.base.kinds.OBJECTIVES,
        *nmm.base.kinds.RESOLVERS,
    )
    assert [kind for kind in kinds if kind not in said] == []
    assert "the end of the longest chain: 3 joints" in said


UP = '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="2"/>'
LEVEL = '<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="2"/>'
FREE = '<axis xyz="0 1 0"/><limit effort="1" velocity="0"/>'
MESH = shape('<mesh filename="none.stl"/>')


def arm(path: Path, *, joints: tuple[str, ...] = (UP, LEVEL, LEVEL), more: str = "") -> Path:
    """An arm without wheels."""
    names = ["base", *(f"link{i + 1}" for i in range(len(joints)))]
    parts = [link(names[0], more), *map(link, names[1:])]
    for i, body in enumerate(joints):
        origin = f'<origin xyz="{0.4 if i else 0} 0 {0 if i else 0.1}"/>'
        kind = "continuous" if body == FREE else "revolute"
        parts.append(joint(f"q{i + 1}", names[i], names[i + 1], kind, body, origin))
    parts += [link("ee"), joint("end", names[-1], "ee", "fixed", "", '<origin xyz="0.3 0 0"/>')]
    return write(path, robot(*parts))


def test_an_arm_without_wheels_gets_a_base_and_is_told(run: Command, tmp_path: Path) -> None:
    file = arm(tmp_path / "arm.urdf")
    made = run("init", str(file))
    assert made.status == 0
    assert "arm.urdf has no wheels: it stands on the bundled differential_base" in made.out
    assert "--platform fixed" in made.out
    data = yaml.safe_load(Path("arm.yaml").read_text(encoding="utf-8"))
    base = {"source": "differential_base", "platform": "unicycle"}
    assert data["robot"] == {"platform": base, "arm": "./arm.urdf"}
    assert run("run", "arm.yaml", "--out", "out").status == 0


def test_paths_are_seen_from_the_file_that_is_written(run: Command, tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "scenarios").mkdir()
    arm(tmp_path / "robots" / "arm.urdf")
    arm(tmp_path / "scenarios" / "own.urdf")
    for file, written in (
        ("robots/arm.urdf", str(tmp_path / "robots/arm.urdf")),
        ("scenarios/own.urdf", "./own.urdf"),
    ):
        out = f"scenarios/{Path(file).stem}.yaml"
        assert run("init", file, "--out", out, "--platform", "unicycle").status == 0
        data = yaml.safe_load(Path(out).read_text(encoding="utf-8"))
        assert data["robot"] == {"source": written, "platform": "unicycle"}
        assert run("run", out, "--out", f"runs/{Path(file).stem}").status == 0


def test_names_with_control_characters_are_written_so_that_they_are_read(
    run: Command, tmp_path: Path
) -> None:
    file = arm(tmp_path / "arm.urdf")
    file.write_text(file.read_text(encoding="utf-8").replace('"ee"', '"ee &#x9b;31m"'), encoding="utf-8")
    started(run, str(file), "--platform", "unicycle")
    assert "\x9b" not in Path("first.yaml").read_text(encoding="utf-8")


def test_figures_show_control_characters_as_they_are_written(tmp_path: Path) -> None:
    made = figure(2.0, 1.0)
    made.text(0.5, 0.5, "ee \x9b31m\nnext")
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # "Glyph 155 missing from font"
        save(made, tmp_path / "a.png")
    assert made.texts[0].get_text() == "ee \\x9b31m\nnext"


@pytest.mark.parametrize("platform", ["fixed", "unicycle"])
def test_a_platform_that_is_asked_for_is_taken(run: Command, tmp_path: Path, platform: str) -> None:
    trajectory = started(run, str(arm(tmp_path / "arm.urdf")), "--platform", platform)
    assert trajectory.robot.platform.name == platform
    assert not trajectory.robot.wheels
    assert np.ptp(trajectory.r, axis=0).max() > 0.02  # it moves


def test_an_arm_is_mounted_where_it_is_asked_for(run: Command, tmp_path: Path) -> None:
    file = arm(tmp_path / "arm.urdf")
    trajectory = started(run, "car_base", "--arm", str(file), "--at", "base_link", "--lock", "q1=0.3")
    assert trajectory.robot.platform.name == "car"
    data = yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))
    assert data["robot"]["at"] == "base_link"
    assert data["robot"]["arm"] == {"source": "./arm.urdf", "lock": {"q1": 0.3}}


def test_it_begins_in_a_posture_that_is_regular(run: Command, tmp_path: Path) -> None:
    def states(**values: float) -> str:
        return "".join(
            f'<group_state name="{name}" group="all">'
            + "".join(f'<joint name="q{i}" value="{value}"/>' for i in (2, 3))
            + '<joint name="q1" value="0.1"/></group_state>'
            for name, value in values.items()
        )

    file = arm(tmp_path / "arm.urdf")
    srdf = tmp_path / "arm.srdf"
    srdf.write_text(f'<robot name="r">{states(other=0.7, home=-0.6)}</robot>', encoding="utf-8")
    started(run, str(file))
    assert yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))["q0"] == {"posture": "home"}
    Path("first.yaml").unlink()
    # Stretched upwards nothing lifts the hand; beyond its limits nothing starts.
    srdf.write_text(f'<robot name="r">{states(home=3.0)}</robot>', encoding="utf-8")
    straight = "".join(f'<joint name="q{i}" value="{v}"/>' for i, v in ((1, 0), (2, -np.pi / 2), (3, 0)))
    started(run, str(file), "--platform", "fixed")
    assert "posture" not in yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))["q0"]
    srdf.write_text(
        f'<robot name="r"><group_state name="home">{straight}</group_state></robot>', encoding="utf-8"
    )
    Path("first.yaml").unlink()
    started(run, str(file), "--platform", "fixed")
    assert "posture" not in yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))["q0"]


def test_it_does_not_begin_inside_its_own_base() -> None:
    draft = nmm.first_scenario(DATA + "ur_description/urdf/ur5_robot.urdf")
    setting = nmm.Collisions(distance=0.0).on(draft.scenario.robot())
    assert setting.check_start(0.0, draft.trajectory.q[0]) == []


def test_shapes_whose_meshes_are_missing_are_left_out_in_writing(run: Command, tmp_path: Path) -> None:
    started(run, str(arm(tmp_path / "arm.urdf", more=MESH)))
    data = yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))
    assert data["robot"]["arm"]["missing_meshes"] == "skip"


def test_a_file_without_limits_has_accelerations_alone(run: Command, tmp_path: Path) -> None:
    started(run, str(arm(tmp_path / "arm.urdf", joints=(FREE, FREE))), "--platform", "unicycle")
    text = Path("first.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(text)["limits"].keys() == {"acceleration"}
    assert "file has no other limits" in " ".join(line.removeprefix("# ") for line in text.splitlines())


@pytest.mark.parametrize(
    ("file", "frame", "joints"),
    [
        ("panda_description/urdf/panda.urdf", "panda_hand_tcp", 7),
        ("tiago_description/robots/tiago.urdf", "hand_tool_link", 8),
        ("talos_data/robots/talos_full_v2.urdf", "wrist_left_ft_tool_link", 9),
        ("so_arm_description/urdf/so101.urdf", "gripper_frame_link", 5),
        ("allegro_hand_description/urdf/allegro_left_hand.urdf", "link_15.0_tip", 4),
        ("finger_edu_description/robots/finger_edu.urdf", "finger_tip_link", 3),
    ],
)
def test_the_hand_is_the_palm_of_the_longest_arm(file: str, frame: str, joints: int) -> None:
    hand = hands(nmm.load(DATA + file, missing_meshes="skip"))[0]
    assert (hand.frame, len(hand.joints)) == (frame, joints)


def test_nothing_is_overwritten(run: Command, tmp_path: Path) -> None:
    kept = tmp_path / "unicycle_2r.yaml"
    kept.write_text("mine", encoding="utf-8")
    made = run("init", "unicycle_2r")
    assert (made.status, made.out, made.err.count("\n")) == (2, "", 1)
    assert made.err.startswith("nmm init: unicycle_2r.yaml: ")
    dangling = tmp_path / "other.yaml"
    dangling.symlink_to(tmp_path / "nowhere.yaml")
    assert run("init", "unicycle_2r", "--out", "other.yaml").status == 2
    assert kept.read_text(encoding="utf-8") == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.yaml", "unicycle_2r.yaml"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("unicycle_4r",), "unknown robot 'unicycle_4r' (did you mean"),
        (("none.urdf",), "none.urdf: no such file"),
        (("unicycle_2r", "--out", "first.txt"), "expected a file that ends in .yaml or .yml"),
        (("unicycle_2r", "--out", "nowhere/first.yaml"), "nowhere is no folder where you may write"),
        (("unicycle_2r", "--at", "ee"), "at: expected an arm"),
        (("unicycle_2r", "--platform", "boat"), "unknown platform 'boat'"),
        (("car_base", "--arm", "small_arm", "--at", "roof"), "unknown frame 'roof'"),
        (("car_base", "--arm", "omni_base"), "has no movable joint, so it is no arm"),
        (("rock.urdf",), "neither wheels nor movable joints: there is nothing to lead"),
        (("stuck.urdf", "--platform", "fixed"), "no first scenario found that runs"),
    ],
)
def test_bad_input_is_one_line(run: Command, tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    write(tmp_path / "rock.urdf", robot(link("base")))
    arm(tmp_path / "stuck.urdf", joints=(LEVEL.replace('"-2"', '"0"').replace('"2" effort', '"0" effort'),))
    before = sorted(tmp_path.iterdir())
    made = run("init", *arguments)
    assert (made.status, made.out, made.err.count("\n")) == (2, "", 1)
    assert said in made.err
    assert sorted(tmp_path.iterdir()) == before


def test_it_is_there_in_python() -> None:
    draft = nmm.first_scenario("unicycle_2r", arguments={"d": 0.5})
    assert draft.scenario.robot().arguments["d"] == "0.5"
    assert draft.trajectory.outcome == "completed"
    with refused(expected="a robot's name or path"):
        nmm.first_scenario(nmm.load("unicycle_2r"))  # type: ignore[arg-type]  # on purpose


def test_a_link_and_a_joint_of_one_name_in_a_robot_without_an_arm(tmp_path: Path) -> None:
    """As ANYmal C has them; here a link `hip` on a joint `hip` ahead of the axle of a bare base."""
    wheel = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
    parts = [link("base"), link("left"), link("hip"), link("right")]
    parts += [
        joint(f"{side}_wheel", "base", side, "continuous", wheel, f'<origin xyz="0 {y} 0.1"/>')
        for side, y in (("left", 0.2), ("right", -0.2))
    ]
    parts.append(joint("hip", "base", "hip", "fixed", "", '<origin xyz="0.3 0 0.2"/>'))
    draft = nmm.first_scenario(write(tmp_path / "r.urdf", robot(*parts)), file=tmp_path / "r.yaml")
    assert draft.trajectory.complete
    assert "frame: hip, " in draft.chosen[1]


CYLINDER = shape('<cylinder radius="0.1" length="0.05"/>')


def wheeled_file(path: Path, places: dict[str, str], kind: str = "continuous") -> Path:
    parts = [
        link("base"),
        link("front"),
        joint("nose", "base", "front", "fixed", "", '<origin xyz="0.4 0 0"/>'),
    ]
    for name, place in places.items():
        origin = f'<origin xyz="{place} 0.1" rpy="-1.5707963 0 0"/>'
        parts += [link(f"{name}_link", CYLINDER)]
        parts += [joint(name, "base", f"{name}_link", kind, '<axis xyz="0 0 1"/>', origin)]
    return write(path, robot(*parts))


def test_no_other_base_is_put_under_wheels_that_do_not_turn(run: Command, tmp_path: Path) -> None:
    file = wheeled_file(tmp_path / "stiff.urdf", {"left_wheel": "0 0.2", "right_wheel": "0 -0.2"}, "fixed")
    made = run("init", str(file), "--out", "first.yaml")
    assert (made.status, made.err) == (0, "")
    assert "links that are called wheels do not turn" in made.out
    assert "differential_base" not in Path("first.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(Path("first.yaml").read_text(encoding="utf-8"))["task"]["frame"] == "front"


def test_it_leads_the_base_not_a_wheel(tmp_path: Path) -> None:
    """With platform unicycle its wheels' links are on the base, and one is farther ahead than its front."""
    file = wheeled_file(
        tmp_path / "r.urdf", {"left_wheel": "0 0.2", "right_wheel": "0 -0.2", "wheel": "0.6 0"}, "fixed"
    )
    assert [hand.frame for hand in hands(nmm.load(file))] == ["front"]


def test_wheels_that_leave_the_platform_open_are_refused_alike(run: Command, tmp_path: Path) -> None:
    file = wheeled_file(
        tmp_path / "r.urdf", {"wheel_a": "0.3 0.2", "wheel_b": "-0.3 0.1", "wheel_c": "0 -0.3"}
    )
    scenario = {"robot": str(file), "duration": 1, "dt": 0.1, "resolver": {"kind": "pg"}, "q0": {}}
    scenario["task"] = {"kind": "position", "frame": "base", "axes": "xy", "reference": [1, 0]}
    Path("s.yaml").write_text(yaml.safe_dump(scenario), encoding="utf-8")
    said = "the wheels do not tell the platform: --platform omnidirectional or --platform unicycle?"
    for arguments in (("check", str(file)), ("info", str(file)), ("init", str(file)), ("run", "s.yaml")):
        made = run(*arguments)
        assert made.status == 2
        assert said in " ".join((made.out + made.err).split()), arguments


@pytest.mark.parametrize("run_up", [0.0, 2.0])
def test_a_circle_from_rest(run_up: float) -> None:
    """Its rate is its value's derivative, it rests before t = 0, and is late by half the run-up after it."""
    robot = nmm.load("unicycle_2r")
    circle = nmm.Circle([1.0, 2.0], 0.5, rate=0.7, phase=0.2, run_up=run_up)
    here = nmm.Configuration(robot, robot.rest)
    times = np.array([-1.0, 0.0, 0.3, 1.0, 1.999, 2.5, 7.0])
    for t in times[(times > 0.0) | (run_up == 0.0)]:
        later, earlier = (nmm.evaluate(circle, t + d, here).value for d in (1e-6, -1e-6))
        np.testing.assert_allclose(nmm.evaluate(circle, t, here).value_t, (later - earlier) / 2e-6, atol=1e-8)
    angle = 0.2 + 0.7 * (7.0 - 0.5 * run_up)
    expected = [1.0 + 0.5 * np.cos(angle), 2.0 + 0.5 * np.sin(angle)]
    np.testing.assert_allclose(nmm.evaluate(circle, 7.0, here).value, expected, atol=1e-12)
    if run_up:
        np.testing.assert_array_equal(nmm.evaluate(circle, 0.0, here).value_t, 0.0)


def test_what_was_sensed_is_an_obstacle_of_the_scenario(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    wall = rng.uniform([2.0, -2.0, 0.0], [2.0, 2.0, 2.0], (20_000, 3))
    np.savez(tmp_path / "scan.npz", points=wall[np.abs(wall[:, 1]) > 0.45])
    cells = np.full((80, 10), 254, dtype=np.uint8)
    cells[:30] = cells[50:] = 0
    Image.fromarray(cells).save(tmp_path / "scan.png")
    keys = "image: scan.png, resolution: 0.05, origin: [2, -2, 0], negate: 0, free_thresh: 0.2"
    write(tmp_path / "scan.yaml", "{" + keys + ", occupied_thresh: 0.65}")
    files = [tmp_path / "scan.npz", tmp_path / "scan.yaml"]
    draft = nmm.first_scenario("unicycle_3r", file=tmp_path / "first.yaml", obstacles=files)
    assert draft.trajectory.complete
    assert 0.03 <= draft.trajectory.clearance_between.min() < 0.2
    assert "file: ./scan.npz" in draft.text
    assert "file: ./scan.yaml" in draft.text
    names = " ".join(draft.trajectory.clearance_names)
    assert "and scan 2" in names or "scan 2 and" in names
    with pytest.raises(nmm.InputError, match="a list of files"):
        nmm.first_scenario("unicycle_2r", obstacles="scan.npz")
    with pytest.raises(nmm.InputError, match=r"unknown kind of obstacle's file '\.xyz'"):
        nmm.first_scenario("unicycle_2r", obstacles=["scan.xyz"])
    with pytest.raises(nmm.InputError, match=r"obstacle nothing\.npz: no such file"):
        nmm.first_scenario("unicycle_2r", obstacles=["nothing.npz"])
