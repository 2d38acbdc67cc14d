"""The tutorial from pixels to inputs: pictures, OpenCV's markers, and the loop that they close."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

pytest.importorskip("cv2")
SCRIPT = ROOT / "docs" / "tutorials" / "dock.py"


@pytest.mark.parametrize("samples", [100, pytest.param(600, marks=pytest.mark.thorough)])
def test_a_robot_drives_up_to_markers_that_its_camera_sees(samples: int, tmp_path: Path) -> None:
    """All the way, or the first 2 s, in which markers are found."""
    code = SCRIPT.read_text(encoding="utf-8")
    assert code.count("range(600)") == 1
    (tmp_path / "dock.py").write_text(code.replace("range(600)", f"range({samples})"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "dock.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found, of, pixels, x, y, size = map(float, re.findall(r"(?<![\w.])\d+(?:\.\d+)?", done.stdout))
    assert of == 2 * samples
    assert found > 0.95 * of
    assert pixels < 0.5
    if samples == 600:
        assert max(x, y) < 0.5
        assert size < 0.5  # per cent
