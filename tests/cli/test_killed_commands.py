"""Every command that writes, ended at any moment: what stands is whole, the next one works, nothing stays."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from killing import Commands, Ended

import nmm

#: NMM_KILLS=30 ends each command so often with each signal; few times do not.
KILLS = int(os.environ.get("NMM_KILLS", "0"))
SHORT = ("--set", "duration=0.2")


@dataclass(frozen=True)
class Case:
    """A command that writes `made`; what it needs, and what makes it short."""

    arguments: tuple[str, ...]
    made: str = "o"
    prepared: tuple[str, str] | None = None


CASES = {
    "run": Case(("run", "unicycle_2r_position", *SHORT, "--html", "--out", "o")),
    "compare": Case(("compare", "unicycle_2r_position", *SHORT, "--out", "o")),
    "laps": Case(("laps", "unicycle_2r_position", "--laps", "1", "--set", "dt=0.05", "--out", "o")),
    "map": Case(("map", "unicycle_2r", "--task", "position", "--samples", "10", "--out", "o")),
    "sweep": Case((
        "sweep", "unicycle_2r_position", "--vary", "q0.x=-1:0", "--samples", "2", "--keep", "trajectories",
        *SHORT, "--jobs", "1", "--out", "o",
    )),
    "paper": Case(("paper", "--out", "o"), prepared=("small_work", "one_case")),
    "init": Case(("init", "small_arm", "--out", "o.yaml"), made="o.yaml"),
    "redundancy": Case((
        "redundancy", "unicycle_3r", "--task", "position", "--at", "q2=1", "--at", "q3=1",
        "--self-motion", "0", "--html", "o.html",
    ), made="o.html"),
    "render": Case(
        ("render", "../run", "--video", "o.mp4", "--fps", "20"), made="o.mp4", prepared=("small_work", "film")
    ),
}  # fmt: skip


def each(*few: str) -> list[Any]:
    """All cases, all but a few of them thorough: they put what they write in its place as these do."""
    return [pytest.param(name, marks=() if name in few else pytest.mark.thorough) for name in CASES]


#: What the last bytes are.
ENDS = {".png": b"IEND\xaeB`\x82", ".html": b"</html>", ".parquet": b"PAR1", ".mp4": b"whole"}


def is_whole(path: Path) -> bool:
    """Whether a file ends as those of its kind do."""
    content = path.read_bytes()
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return all(arrays[name] is not None for name in arrays.files)
    if path.suffix == ".json":
        return isinstance(json.loads(content), dict)
    if path.suffix == ".yaml":
        return isinstance(yaml.safe_load(content), dict) and content.endswith(b"\n")
    if path.suffix == ".csv":
        return len({line.count(b",") for line in content.splitlines()}) == 1 and content.endswith(b"\n")
    return content.rstrip(b"\n").endswith(ENDS[path.suffix])


def files(place: Path) -> set[str]:
    """All files below, each of which is whole; what is hidden is none."""
    found = [place] if place.is_file() else [path for path in place.rglob("*") if path.is_file()]
    names = {path: path.relative_to(place.parent) for path in found}
    seen = {path: str(name) for path, name in names.items() if not any(part[0] == "." for part in name.parts)}
    assert [path for path in seen if not is_whole(path)] == []
    return set(seen.values())


def hidden(folder: Path) -> list[str]:
    """What a command has left of its work."""
    return [str(path) for path in folder.rglob(".*") if path.name != ".lock"]


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    with Commands(tmp_path_factory.mktemp("scratch")) as found:
        yield found


def moment(touched: list[str], rng: random.Random) -> tuple[int, float]:
    """The number of a touched file, and s after: often about the one that puts the new in its place."""
    put = max(k for k, what in enumerate(touched) if what in ("ctypes.dlsym", "os.rename", "os.link"))
    if rng.random() < 0.5:
        return put + rng.choice((-1, 0, 1)), 0.0
    return rng.randrange(len(touched)), rng.choice((0.0, 0.03 * rng.random()))


def content(place: Path) -> dict[str, bytes]:
    return {name: (place.parent / name).read_bytes() for name in files(place)} if place.exists() else {}


def check_end(name: str, ended: Ended) -> None:
    """A command that was asked to end had done its work, or says that it has not."""
    if ended.status == 0:
        assert ended.err == ""
    else:
        assert ended.status in (1, 130), ended
        assert re.fullmatch(rf"nmm {name}: ([A-Z]+ )?interrupted.*\n", ended.err), ended


@pytest.mark.parametrize("name", each("run", "sweep", "init", "redundancy"))
def test_ended_at_any_moment(tmp_path: Path, commands: Commands, name: str) -> None:
    rng, case, folder = random.Random(name), CASES[name], tmp_path / "here"
    made, resumed, refused = folder / case.made, name == "sweep", name == "init"
    if name == "render":
        nmm.Scenario.load("unicycle_2r_position").override("duration", 0.2).run().save(tmp_path / "run")
    folder.mkdir()

    def run(**when: Any) -> Ended:
        return commands.run(folder, [*case.arguments], prepared=case.prepared, **when)

    first = run()
    assert (first.status, first.err) == (0, "")
    whole, second = files(made), run()
    assert second.status == (2 if refused else 0)
    signals = [signal.SIGTERM, signal.SIGINT] * max(1, KILLS) + [signal.SIGKILL] * max(2, KILLS)
    for k, number in enumerate(signals):
        fresh = resumed or refused or k % 2 == 0
        if fresh:
            shutil.rmtree(made) if made.is_dir() else made.unlink(missing_ok=True)
        before, touched = content(made), first.touched if fresh else second.touched
        at, later = moment(touched, rng)
        ended, now = run(number=number, at=at, later=later), content(made)
        if not resumed and now != before:
            assert now.keys() == whole
        if ended.status == 0:
            assert now.keys() == whole
        if number == signal.SIGKILL:
            assert ended.status in (0, -number), ended
        else:
            check_end(name, ended)
            assert hidden(folder) == []
    if refused:
        made.unlink(missing_ok=True)
    last = run()
    assert (last.status, last.err) == (0, "")
    assert files(made) == whole
    assert hidden(folder) == []
    assert [path.name for path in folder.iterdir()] == [case.made]
