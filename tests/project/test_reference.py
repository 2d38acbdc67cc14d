"""The reference lists every public name once, and each has an example that runs."""

from __future__ import annotations

import doctest
import inspect
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest
from matplotlib.figure import Figure
from places import ROOT

import nmm
from nmm.motion.recording import Recorder

#: Packages whose names are public; those that `nmm` or `nmm.extending` has too are listed there.
PUBLIC = ("analysis", "driving", "figures", "playback", "rendering", "ros")
#: Names of `nmm.extending` with an entry each: what authors write, and results that one gets but never makes.
# fmt: off
AUTHORS = [
    "AddedJoint", "AnswerArrays", "Dimensions", "Evaluation", "Event", "Function", "Kernel",
    "Layout", "LimitReport", "LimitStage", "LiveNumbers", "MimicJoint", "NamedPostures", "Objective",
    "PiecewisePolynomial", "PinocchioModels", "Pivot", "Platform", "ProblemArrays", "Quantity",
    "Residuals", "Resolver", "RollingJoint", "Rollouts", "Row", "RowLimit", "Semantics", "Setup", "Shape",
    "Shapes", "Shown", "Stage", "State", "SteeredAxle", "SteeringPivot", "Step", "SweepResult",
    "Table", "Wheel", "WheelDescription", "WheelRate",
]
# fmt: on


def public_names() -> dict[str, object]:
    """Every public name, in full, with what it is."""
    names = {f"nmm.{name}": getattr(nmm, name) for name in nmm.__all__}
    for room in PUBLIC:
        module = getattr(nmm, room)
        for name in module.__all__:
            if name not in nmm.__all__ and name not in AUTHORS:
                names[f"nmm.{room}.{name}"] = getattr(module, name)
    names |= {f"nmm.extending.{name}": getattr(nmm.extending, name) for name in AUTHORS}
    return {name: thing for name, thing in names.items() if not inspect.ismodule(thing)}


THINGS = public_names()


def test_the_reference_lists_every_public_name_once() -> None:
    pages = {path.stem: path.read_text("utf-8") for path in (ROOT / "docs" / "api").glob("*.md")}
    listed = [found for page in pages.values() for found in re.findall(r"\.\. auto(\w+):: (\S+)", page)]
    run = "for classes of nmm/base/kinds.py run python docs/make_kind_lists.py"
    assert Counter(name for _, name in listed) == Counter([*THINGS]), run
    for kind, name in listed:
        thing = THINGS[name]
        error = inspect.isclass(thing) and issubclass(thing, Exception)
        assert kind == ("exception" if error else "class" if inspect.isclass(thing) else "function"), name
    assert {*re.findall(r"`(\w+)`", pages["index"])} >= {name.rpartition(".")[2] for _, name in listed}


#: What needs more than nmm: a browser.
NEEDS = {"nmm.rendering.render": pytest.mark.browser}


@pytest.mark.parametrize("name", [pytest.param(one, marks=NEEDS.get(one, ())) for one in THINGS])
def test_a_public_name_has_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its own docstring, not in one that it inherits; nmm and np are there, as docs/api/index.md says."""
    monkeypatch.chdir(tmp_path)
    thing = THINGS[name]
    text = (vars(thing)["__doc__"] if inspect.isclass(thing) else thing.__doc__) or ""
    example = doctest.DocTestParser().get_doctest(text, {"nmm": nmm, "np": np}, name, None, None)
    assert example.examples, f"{name}: expected a section Examples in its docstring"
    told: list[str] = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example, out=told.append)
    assert not told, "".join(told)


#: Members that nmm's rooms call of each other: nobody else makes or reads what they take and give.
INNER = {
    "nmm.Bound.rows",
    "nmm.Collisions.on",
    "nmm.Controller.blocks",
    "nmm.Controller.compiled",
    "nmm.Controller.safety_filter",
    "nmm.Controller.period_monitor",
    "nmm.Disturbances.on",
    "nmm.extending.LimitReport.__init__",  # made by a controller
    "nmm.Limits.on",
    "nmm.Localisation.on",
    "nmm.Plan.__init__",  # made by `nmm.plan`
    "nmm.Plan.found",
    "nmm.Retreat.on",
    "nmm.Robot.joints",
    "nmm.Scenario.__init__",  # made by load and from_dict
    "nmm.SequencedController.moment",
    "nmm.SequencedController.settle",
    "nmm.Stack.on",
    "nmm.Steering.on",
    "nmm.analysis.About.of",
}
#: Types in the place of a public one, which lies in a room above: any Collisions; LiveRun's recorder, which
#: simulate hands it; what a Swept read of its folder.
IN_THE_PLACE = {"Distances", "Recorder", "Definition"}
#: Types that have a name in `nmm.extending`, for packages above the wall, and no place in the reference.
ABOVE_THE_WALL = {
    "HeldOut",
    "DriveNoise",
    "ArmHeldOut",
    "SightingNoise",
    "Awaited",
    "Plant",
    "RunCamera",
    "Schedule",
    "Sight",
    "Sequence",
    "Steered",
    "StepSolver",
    "Verdict",
}
#: Where a property, a cached one, a class's or a static method has its function.
WRAPPED = ("fget", "func", "__func__")


def types_in(annotation: object) -> Iterator[type]:
    """The classes that an annotation speaks of."""
    if isinstance(annotation, type):
        yield annotation
    for part in (get_origin(annotation), *get_args(annotation)):
        for one in part if isinstance(part, list) else [part]:
            if one is not None:
                yield from types_in(one)


def annotated(name: str) -> Iterator[tuple[str, object]]:
    """A public name's members as the reference shows them, each with what it takes, holds or gives."""
    thing = THINGS[name]
    known = {one.__name__: one for one in THINGS.values() if inspect.isclass(one)}
    known |= {"Figure": Figure, "Recorder": Recorder}  # imported for their types alone
    functions = {name: thing}
    if inspect.isclass(thing):
        yield from ((f"{name}.{key}", hint) for key, hint in get_type_hints(thing, localns=known).items())
        functions = {
            f"{name}.{key}": next(filter(None, (getattr(member, part, None) for part in WRAPPED)), member)
            for key, member in vars(thing).items()
            if key == "__init__" or (key[0] != "_" and member.__doc__)
        }
    for where, function in functions.items():
        if inspect.isfunction(function):
            yield from ((where, hint) for hint in get_type_hints(function, localns=known).values())


def test_what_a_public_name_takes_or_gives_has_a_public_name() -> None:
    public = {*THINGS.values()} | {getattr(nmm.extending, name) for name in ABOVE_THE_WALL}
    reached = {
        f"{where}: {one.__module__}.{one.__name__}"
        for name in THINGS
        for where, hint in annotated(name)
        if where not in INNER
        for one in types_in(hint)
        if one.__module__.startswith("nmm") and one not in public and one.__name__ not in IN_THE_PLACE
    }
    assert not reached, "\n".join(sorted(reached))
