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


def test_a_robot_drives_up_to_markers_that_its_camera_sees(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found, of, pixels, x, y, size = map(float, re.findall(r"(?<![\w.])\d+(?:\.\d+)?", done.stdout))
    assert of == 1200.0
    assert found > 0.95 * of
    assert pixels < 0.5
    assert max(x, y) < 0.5
    assert size < 0.5  # per cent
