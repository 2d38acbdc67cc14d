"""A stranger's xacro file computes, and reads its own robot's files; only a trusted one runs programs."""

import inspect
import pickle
from pathlib import Path

import pytest
import yaml
from findings import holds

import nmm
from nmm.base.trust import trusting
from nmm.cli.app import app
from nmm.cli.exit_status import status_of
from nmm.model.robots.loading.report import file_report

pytestmark = pytest.mark.usefixtures("xacro_each_time")

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
INNER = f'{HEAD}<link name="inner"/></robot>'


def written(file: Path, *parts: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([HEAD, *parts, "</robot>"]), encoding="utf-8")
    return file


def links(file: Path, **options: object) -> list[str]:
    model = nmm.load(file, platform="fixed", **options).model  # type: ignore[arg-type]  # each test gives its own
    return [frame.name for frame in model.frames if frame.type == frame.type.BODY]


def refusal(file: Path, **options: object) -> tuple[nmm.RobotError, nmm.Finding]:
    with pytest.raises(nmm.RobotError) as caught:
        links(file, **options)
    assert len(str(caught.value).replace(str(file.parent), "")) <= 300  # wherever the tests run
    (found,) = caught.value.findings
    assert found.code == "xacro_untrusted"
    assert "--trust" in str(caught.value)
    return caught.value, found


#: Harmless expressions, each of a kind that leads on to Python, and what each gives.
PROGRAMS = {
    "method": ("'ab'.upper()", "AB", ".upper of a str"),
    "class": ("''.__class__", "str", "the name __class__"),
    "class of a number": ("(1).real", "1", ".real of a int"),
    "method of a table": ("len(math.items()) > 9", "True", "items"),
    "lambda": ("(lambda: 3)()", "3", "a function of its own (lambda)"),
    "assignment": ("(a := 3)", "3", "an assignment (:=)"),
    "class of a function": ("python.type(python.len) == 3", "False", "python.type of a builtin_function"),
    "class of a class": ("python.type(str) == 3", "False", "python.type of a type"),
    "vars": ("len(python.vars(math)) > 1", "True", "python.vars"),
    "separators": ("xacro.tokenize('a1b', '0-9]|[x')[0]", "a", "separators that are a pattern"),
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_expressions_that_lead_to_python_are_refused(tmp_path: Path, name: str) -> None:
    expression, value, what = PROGRAMS[name]
    text = expression.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    file = written(tmp_path / "r.xacro", "", f'<link name="${{{text}}}"/>')
    if name == "method of a table":
        with pytest.raises(nmm.RobotError, match="items"):
            links(file)
    else:
        error, found = refusal(file)
        assert what in found.values["what"]
        assert str(error).startswith(f"{file}: line 3: ")
    if "__" not in expression and "(lambda" not in expression:
        assert value in links(file, trust=True)


@pytest.mark.parametrize("function", ["open", "exec", "getattr", "compile"])
def test_eval_has_none_of_pythons_other_functions(tmp_path: Path, function: str) -> None:
    file = written(tmp_path / "r.xacro", f'<link name="$(eval {function})"/>')
    with pytest.raises(nmm.RobotError, match=f"'{function}' is not defined"):
        links(file)
    assert any(function in link for link in links(file, trust=True))


#: What real files ask for, and what each gives.
COMPUTED = {
    "2*pi/2 == math.pi and not 1 &gt; 2": "True",
    "'left' if -3 % 2 else 'right'": "left",
    "dict(a=[1, 2])['a'][-1]": "2",
    "'%.2f' % radians(90)": "1.57",
    "[i * i for i in python.range(4)][1:]": "[1, 4, 9]",
    "max(map(abs, [-3, 2]), 1)": None,
    "python.max(map(float, ['1', '4']))": "4.0",
    "python.sum([1, 2, 3])": "6",
    "python.type(1.5) in [python.int, python.float]": "True",
    "python.str(python.ord('a'))": "97",
    "xacro.tokenize('a, b')[1]": "b",
    "2**10 &lt;&lt; 1": "2048",
    "'a' 'b' + 'c'*2": "abcc",
    "'x' in ['x', 'y'] or nothing": "True",
}


@pytest.mark.parametrize("expression", COMPUTED)
def test_arithmetic_and_xacros_functions_need_no_trust(tmp_path: Path, expression: str) -> None:
    file = written(tmp_path / "r.xacro", f'<link name="${{{expression}}}"/>')
    if COMPUTED[expression] is None:  # no name of xacro's; the same as where it is trusted
        with pytest.raises(nmm.RobotError, match="'abs' is not defined"):
            links(file)
        return
    assert COMPUTED[expression] in links(file)
    assert links(file, trust=True) == links(file)


@pytest.mark.parametrize(
    "parts",
    [
        "".join(f'<xacro:property name="a{k + 1}" value="${{[a{k}, a{k}]}}"/>' for k in range(40)),
        '<xacro:property name="a40" value="${math.prod([[0], 10**9])}"/>',
        '<xacro:property name="a40" value="${list(map(list, map(python.range, [10**10])))}"/>',
        '<xacro:property name="a40" value="${\'%999999999d\' % 1}"/>',
    ],
    ids=["lists of lists", "product", "map", "width"],
)
def test_what_grows_unseen_is_refused(tmp_path: Path, parts: str) -> None:
    file = written(
        tmp_path / "r.xacro", '<xacro:property name="a0" value="x"/>', parts, '<link name="${a40}"/>'
    )
    for trust in (False, True):
        with pytest.raises(nmm.RobotError) as caught:
            links(file, trust=trust)
        assert holds(caught.value.findings[0], "beyond_bound")


def test_yaml_is_read_with_dots(tmp_path: Path) -> None:
    (tmp_path / "sizes.yaml").write_text("arm: {items: 3, names: [a, b]}", encoding="utf-8")
    file = written(
        tmp_path / "r.xacro",
        '<xacro:property name="sizes" value="${xacro.load_yaml(\'sizes.yaml\')}"/>',
        "<link name=\"${sizes.arm.names[1]}${sizes['arm']['items']}\"/>",
    )
    assert "b3" in links(file)


def test_the_environment_is_read_only_where_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NMM_SET", "set")
    file = written(tmp_path / "r.xacro", '<link name="$(env NMM_SET)"/>')
    assert refusal(file)[1].values == {"what": "environment variable NMM_SET"}
    assert "set" in links(file, trust=True)


def test_an_optional_variable_has_its_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NMM_SET", "set")
    file = written(tmp_path / "r.xacro", '<link name="$(optenv NMM_SET plain)$(optenv NMM_UNSET x)"/>')
    robot = nmm.load(file, platform="fixed")
    assert [note.values["text"] for note in robot.notes if note.code == "xacro_warned"] == [
        "warning: environment variable NMM_SET is not read (--trust, trust=True): 'plain' is taken"
    ]
    assert "plainx" in links(file)
    assert "setx" in links(file, trust=True)


@pytest.mark.parametrize(
    "part",
    [
        '<xacro:include filename="{other}"/>',
        '<xacro:include filename="../other/part.xacro"/>',
        '<xacro:include filename="{folder}/*.xacro"/>',
        '<xacro:include filename="link.xacro"/>',
        '<xacro:include filename="{hidden}"/>',
    ],
    ids=["absolute", "relative", "pattern", "symbolic link", "hidden"],
)
def test_files_elsewhere_are_read_only_where_trusted(tmp_path: Path, part: str) -> None:
    other, hidden = tmp_path / "other" / "part.xacro", tmp_path / "robot" / ".hidden" / "part.xacro"
    for file in (other, hidden):
        file.parent.mkdir(parents=True)
        file.write_text(INNER, encoding="utf-8")
    (tmp_path / "robot" / "link.xacro").symlink_to(other)
    text = part.format(other=other, folder=other.parent, hidden=hidden)
    file = written(tmp_path / "robot" / "r.xacro", text, '<link name="a"/>')
    error, found = refusal(file)
    assert "outside its folder and packages" in found.values["what"]
    assert str(error).startswith(str(file))
    with pytest.raises(nmm.RobotError, match="one root link"):  # it is read: there are two now
        links(file, trust=True)


def test_yaml_elsewhere_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text("a: b", encoding="utf-8")
    call = f"xacro.load_yaml('{tmp_path}/other.yaml')['a']"
    file = written(tmp_path / "robot" / "r.xacro", f'<link name="${{{call}}}"/>')
    refusal(file)
    assert "b" in links(file, trust=True)


def test_the_robots_package_is_read(tmp_path: Path) -> None:
    written(tmp_path / "my_description" / "parts" / "part.xacro", '<link name="inner"/>')
    file = written(tmp_path / "my_description" / "robots" / "r.xacro")
    file.write_text(f'{HEAD}<xacro:include filename="../parts/part.xacro"/></robot>', encoding="utf-8")
    assert "inner" in links(file)  # around a folder called so
    own = written(tmp_path / "my_description" / "own" / "r.xacro")
    own.write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    refusal(own)
    (tmp_path / "my_description" / "package.xml").write_text("<package/>", encoding="utf-8")
    assert "inner" in links(own)


def test_packages_that_are_named_are_read_through_links(tmp_path: Path) -> None:
    source = written(tmp_path / "src" / "part.xacro", '<link name="inner"/>')
    share = tmp_path / "share" / "pk"
    share.mkdir(parents=True)
    (share / "part.xacro").symlink_to(source)
    file = written(tmp_path / "robot" / "r.xacro", '<xacro:include filename="$(find pk)/part.xacro"/>')
    assert "inner" in links(file, package_dirs=[tmp_path / "share"])


def test_a_line_in_an_included_file_is_named(tmp_path: Path) -> None:
    written(tmp_path / "part.xacro", "", "<link name=\"${'a'.upper()}\"/>")
    file = written(tmp_path / "r.xacro", '<xacro:include filename="part.xacro"/>')
    error, found = refusal(file)
    assert found.where == {"file": str(tmp_path / "part.xacro"), "line": 3}
    assert str(error).startswith(f"{file}: in {tmp_path / 'part.xacro'}:3: ")


def test_reports_say_what_files_may_do(tmp_path: Path) -> None:
    file = written(tmp_path / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    assert [one.code for one in file_report(file).problems] == ["xacro_untrusted"]
    trusted = file_report(file, trust=True, platform="fixed")
    assert trusted.problems == ()
    assert trusted.facts["xacro"].startswith("trusted")
    plain = file_report(written(tmp_path / "r.xacro", '<link name="a"/>'), platform="fixed")
    assert plain.facts["xacro"].startswith("computes only")


def test_trust_ends_with_the_call(tmp_path: Path) -> None:
    file = written(tmp_path / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    assert "A" in links(file, trust=True)
    refusal(file)
    with pytest.raises(nmm.RobotError, match="trust"):
        links(file, trust="yes")


def test_commands_take_trust(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    command = ["check", str(file), "--platform", "fixed"]
    assert status_of(command) == 2
    assert "--trust" in " ".join(capsys.readouterr().out.split())
    assert status_of([*command, "--trust"]) == 0
    assert "trusted: it may run programs" in capsys.readouterr().out


def test_a_scenarios_robot_is_trusted_by_whoever_runs_it(tmp_path: Path) -> None:
    file = written(tmp_path / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    robot = {"source": str(file), "platform": "unicycle", "wheels": []}
    scenario = nmm.Scenario.load("unicycle_2r_position", {"robot": robot})
    with pytest.raises(nmm.ScenarioError, match="--trust"):
        scenario.robot()
    with trusting(True):  # as --trust does
        assert scenario.robot().n == 3


def test_a_runs_robot_is_trusted_by_whoever_loads_it(tmp_path: Path) -> None:
    file = written(tmp_path / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    robot = nmm.load(file, platform="unicycle", wheels=[], trust=True)
    controller = nmm.Controller(robot, nmm.Task(nmm.Posture("x"), [1.0]), nmm.ProjectedGradient())
    nmm.simulate(controller, robot.rest, 0.02, 0.01).save(tmp_path / "run", figures=False)
    with pytest.raises(nmm.InputError, match="trust"):
        nmm.Trajectory.load(tmp_path / "run")
    assert len(nmm.Trajectory.load(tmp_path / "run", trust=True)) == 3


def test_a_sweeps_robots_are_trusted_by_whoever_loads_it(tmp_path: Path) -> None:
    scenario, file = scenario_of_a_program(tmp_path), tmp_path / "sweep.yaml"
    file.write_text(f"scenario: {scenario}\nvary: {{q0.x: [0.0, 0.1]}}\n", encoding="utf-8")
    with pytest.raises(nmm.InputError, match="trust"):
        nmm.Sweep.load(file)
    done = nmm.Sweep.load(file, trust=True).run(tmp_path / "sweep", jobs=1)
    assert sum(done.outcomes.values()) == 2


def test_scenarios_cannot_trust_themselves() -> None:
    assert "trust" not in nmm.Scenario.load("unicycle_2r_position").resolved()["robot"]
    with pytest.raises(nmm.ScenarioError):
        nmm.Scenario.load("unicycle_2r_position", {"robot.trust": True})


#: Short texts that a machine would work or fill its memory for.
HUNGRY = {
    "format": "len((\"%(a)s\" * 2000) % dict(a='x' * 10**6))",
    "rounded": "round(7, -20000000)",
    "multiple": f"math.lcm({', '.join(str(10**9 + 7 + 2 * k) for k in range(500))})",
    "slices": "len([('x' * 10**7)[k:] for k in python.range(10)])",
    "slice by its object": "len([('x' * 10**7)[python.slice(k, None)] for k in python.range(10)])",
    "rows": f"len(list(python.zip({', '.join(['python.range(10**6)'] * 49)})))",
    "printed": "len([xacro.message('x' * 10**6) for k in python.range(60)])",
}


@pytest.mark.parametrize("name", HUNGRY)
def test_expressions_that_ask_for_gigabytes_or_hours_are_refused(tmp_path: Path, name: str) -> None:
    text = HUNGRY[name].replace("<", "&lt;").replace('"', "&quot;")
    file = written(tmp_path / "r.xacro", f'<link name="${{{text}}}"/>')
    for trust in (False, True):
        with pytest.raises(nmm.RobotError) as caught:
            links(file, trust=trust)
        assert holds(caught.value.findings[0], "beyond_bound"), caught.value


def test_sets_of_sets_are_counted_by_what_they_say(tmp_path: Path) -> None:
    parts = "".join(
        f'<xacro:property name="a{k + 1}" value="${{python.frozenset([(a{k}, 1), (a{k}, 2)])}}"/>'
        for k in range(40)
    )
    file = written(
        tmp_path / "r.xacro",
        '<xacro:property name="a0" value="x"/>',
        parts,
        '<link name="${len(str(a40))}"/>',
    )
    with pytest.raises(nmm.RobotError) as caught:
        links(file)
    assert holds(caught.value.findings[0], "beyond_bound")


def test_folders_elsewhere_are_not_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other").mkdir()
    listed: list[str] = []
    monkeypatch.setattr("glob.glob", lambda pattern: listed.append(pattern) or [])
    for pattern in (f"{tmp_path}/other/*.xacro", f"{tmp_path}/*/part.xacro", "*/../../other/*.xacro"):
        file = written(tmp_path / "robot" / "r.xacro", f'<xacro:include filename="{pattern}"/>')
        refusal(file)
    assert listed == []
    own = written(
        tmp_path / "robot" / "r.xacro", '<xacro:include filename="parts/*.xacro"/>', '<link name="a"/>'
    )
    links(own)
    assert listed == [str(tmp_path / "robot" / "parts" / "*.xacro")]


def scenario_of_a_program(folder: Path) -> Path:
    """A scenario whose robot's file calls a method."""
    written(folder / "r.xacro", "<link name=\"${'a'.upper()}\"/>")
    robot = {"source": str(folder / "r.xacro"), "platform": "omnidirectional", "wheels": []}
    task = {"kind": "position", "frame": "A", "axes": "xy", "reference": [1.0, 0.5]}
    data = {"robot": robot, "q0": {}, "task": task, "duration": 0.05, "resolver": {"kind": "pg"}}
    file = folder / "own.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    return file


def test_scenarios_are_trusted_from_python(tmp_path: Path) -> None:
    file = scenario_of_a_program(tmp_path)
    with pytest.raises(nmm.ScenarioError, match="--trust"):
        nmm.Scenario.load(file).robot()
    trusted = nmm.Scenario.load(file, trust=True)
    assert trusted.robot().n == 3
    assert trusted.override("robot.limits", {"vx": 0.5}).robot().n == 3
    assert pickle.loads(pickle.dumps(trusted)).robot().n == 3


def test_every_command_that_opens_a_scenario_or_run_takes_trust(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    without = {"paper", "scenarios", "robots"}
    taking = {
        command.name: "trust" in inspect.signature(command.callback).parameters
        for command in app.registered_commands
        if command.callback is not None
    }
    assert {name for name, takes in taking.items() if not takes} == without
    file, run, log = scenario_of_a_program(tmp_path), tmp_path / "run", tmp_path / "a.mcap"
    assert status_of(["run", str(file), "--out", str(run), "--trust"]) == 0
    for trust, status in ((["--trust"], 0), ([], 2)):
        assert status_of(["export", str(run), str(log), "--mcap", *trust]) == status
    assert "--trust" in capsys.readouterr().err


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_rows_of_a_sweep_are_trusted(tmp_path: Path, jobs: str) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    file = scenario_of_a_program(tmp_path)
    command = ["sweep", str(file), "--vary", "robot.limits.vx=0.5,0.6,0.7", "--jobs", jobs]
    assert status_of([*command, "--out", str(tmp_path / "refused")]) == 2
    assert status_of([*command, "--out", str(tmp_path / "swept"), "--trust"]) == 0
    rows = pq.read_table(tmp_path / "swept" / "rows.parquet", partitioning=None)
    assert rows["outcome"].to_pylist() == ["completed"] * 3


@pytest.mark.parametrize(
    "expression",
    [
        "round(ndigits=-200000, number=7)",
        "1.5 in python.range(3 * 10**7) or 2.5 in python.range(3 * 10**7)",
        "1.5 not in python.range(9 * 10**7)",
    ],
)
def test_work_is_bounded_also_where_it_is_asked_for_by_name_or_by_in(tmp_path: Path, expression: str) -> None:
    with pytest.raises(nmm.RobotError, match="no robot needs as many"):
        links(written(tmp_path / "a.xacro", f"<link name='x${{{expression}}}'/>"))


def test_what_is_refused_is_said_shortly(tmp_path: Path) -> None:
    error, _ = refusal(written(tmp_path / "a.xacro", f"<link name='${{(1).{'long' * 90}}}'/>"))
    assert "..." in str(error)
