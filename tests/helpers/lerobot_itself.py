"""What LeRobot's own loader, recorder and tools make of a data set. Run by a Python that has LeRobot, 0.4.4
to 0.6.1, which need not have nmm: python lerobot_itself.py JOB FOLDER OUT."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.datasets import dataset_tools
from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats
from lerobot.datasets.lerobot_dataset import LeRobotDataset

try:
    from lerobot.datasets.utils import hw_to_dataset_features
except ImportError:
    from lerobot.utils.feature_utils import hw_to_dataset_features

ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
#: `LeKiwi._state_ft`, which needs the servos' package.
LEKIWI = {**{f"arm_{name}.pos": float for name in ARM}, "x.vel": float, "y.vel": float, "theta.vel": float}


def opened(folder: Path, **options: Any) -> LeRobotDataset:
    return LeRobotDataset("local/test", root=folder, **options)


def load(folder: Path, out: Path) -> dict[str, Any]:
    """All frames one by one, chunks of actions at the ends of episodes, statistics by LeRobot's means."""
    data = opened(folder)
    items = [data[k] for k in range(len(data))]
    columns = {name: np.array([np.asarray(item[name]) for item in items]) for name in data.features}
    np.savez(out, **columns)
    step = 1.0 / data.fps
    ahead = opened(folder, delta_timestamps={"action": [0.0, step, 2 * step]})
    batch = next(iter(torch.utils.data.DataLoader(ahead, batch_size=4, shuffle=False)))
    each = []
    for told in data.meta.episodes:
        own = slice(told["dataset_from_index"], told["dataset_to_index"])
        each.append(compute_episode_stats({name: rows[own] for name, rows in columns.items()}, data.features))
    last = [told["dataset_to_index"] - 1 for told in data.meta.episodes]
    subset = opened(folder, episodes=[data.num_episodes - 1])
    return {
        "version": version("lerobot"),
        "frames": len(data),
        "episodes": [
            [told["dataset_from_index"], told["dataset_to_index"], told["length"]]
            for told in data.meta.episodes
        ],
        "fps": data.fps,
        "robot_type": data.meta.robot_type,
        "names": {name: list(names) if names else None for name, names in data.meta.names.items()},
        "tasks": [item["task"] for item in items],
        "padded": [ahead[k]["action_is_pad"].tolist() for k in last],
        "batch": list(batch["action"].shape),
        "subset": len(subset),
        "stats": plain(data.meta.stats),
        "own": plain(aggregate_stats(each)),
        "each": [plain(stats) for stats in each],
    }


def pictures(folder: Path, out: Path) -> dict[str, Any]:
    """The pictures of all frames as LeRobot decodes them; what this installation lacks for it."""
    data = opened(folder, video_backend="pyav")
    try:
        items = [data[k] for k in range(len(data))]
    except (AttributeError, ImportError) as error:  # torchvision without its reader, no torchcodec
        return {"lacks": str(error)}
    keys = data.meta.video_keys
    np.savez(out, **{key: np.array([item[key].numpy() for item in items]) for key in keys})
    return {"keys": [*keys], "stats": plain({key: data.meta.stats[key] for key in keys})}


def plain(stats: dict[str, Any]) -> dict[str, Any]:
    return {
        name: {key: np.asarray(value).tolist() for key, value in of.items()} for name, of in stats.items()
    }


def edit(folder: Path, out: Path) -> dict[str, Any]:
    """The first episode taken out, and what is left put together with the whole, by LeRobot's tools."""
    left = dataset_tools.delete_episodes(opened(folder), [0], output_dir=out / "left", repo_id="local/left")
    both = dataset_tools.merge_datasets([opened(folder), left], "local/both", output_dir=out / "both")
    return {"left": left.meta.total_episodes, "both": both.meta.total_episodes}


def record(folder: Path, out: Path) -> dict[str, Any]:
    """Two episodes of LeKiwi as `lerobot-record` makes them; actions are 1.5 times the velocity measured."""
    features = hw_to_dataset_features(LEKIWI, "observation") | hw_to_dataset_features(LEKIWI, "action")
    data = LeRobotDataset.create(
        "local/lekiwi", fps=10, root=folder, features=features, robot_type="lekiwi_client", use_videos=False
    )
    for length in (21, 6):
        add(data, length)
    finish(data)
    return {}


def go_on(folder: Path, out: Path) -> dict[str, Any]:
    """One more episode after those that are there."""
    data = (
        LeRobotDataset.resume("local/test", root=folder)
        if hasattr(LeRobotDataset, "resume")
        else opened(folder)
    )
    for k in range(5):
        frame = {
            name: np.full(told["shape"], 0.01 * k, np.float32)
            for name, told in data.features.items()
            if told["dtype"] == "float32" and name != "timestamp"
        }
        data.add_frame({**frame, "task": "go on"})
    data.save_episode()
    finish(data)
    return {}


def add(data: LeRobotDataset, length: int) -> None:
    for k in range(length):
        state = np.zeros(len(LEKIWI), np.float32)
        state[:3] = -30, 10 + k, 50
        state[5:] = 25, 0.5 * np.pi / 4, 0, 45
        data.add_frame({"observation.state": state, "action": state * np.float32(1.5), "task": "drive"})
    data.save_episode()


def finish(data: LeRobotDataset) -> None:
    data.finalize()


if __name__ == "__main__":
    job, folder, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    jobs = {"load": load, "edit": edit, "record": record, "go_on": go_on, "pictures": pictures}
    print(json.dumps(jobs[job](folder, out)))
