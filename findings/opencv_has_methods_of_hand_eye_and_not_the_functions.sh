#!/usr/bin/env bash
# OpenCV 5's Python package has hand-eye calibration's constants, and not its functions.
#
# Expected: cv2.calibrateHandEye and cv2.calibrateRobotWorldHandEye, which OpenCV has had since 4.1 and 4.5, and
# to which the constants CALIB_HAND_EYE_PARK, CALIB_ROBOT_WORLD_HAND_EYE_SHAH and their like are passed.
#
# What happens: the package for OpenCV 5.0 has the seven constants, but no function takes them: both names are an
# AttributeError. The package for 4.13 has both.
#
# For users: hand-eye calibration by OpenCV needs a package below 5, or another closed form. nmm.calibrate has its own.
# Versions: opencv-python-headless 5.0.0.93 and 4.13.0.92.
#
# Output:
#   5.0.0: 7 constants, functions: none
#   4.13.0: 7 constants, functions: calibrateHandEye, calibrateRobotWorldHandEye
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for version in 5.0.0.93 4.13.0.92; do
  python3 -m venv "venv$version"
  "venv$version/bin/pip" install -q "opencv-python-headless==$version"
  "venv$version/bin/python" - <<'END'
import cv2

constants = [name for name in dir(cv2) if name.startswith(("CALIB_HAND_EYE_", "CALIB_ROBOT_WORLD_HAND_EYE_"))]
functions = [name for name in ("calibrateHandEye", "calibrateRobotWorldHandEye") if hasattr(cv2, name)]
print(f"{cv2.__version__}: {len(constants)} constants, functions: {', '.join(functions) or 'none'}")
if len(constants) != 7 or len(functions) != (0 if cv2.__version__.startswith("5.") else 2):
    raise SystemExit("The behaviour changed: OpenCV 5 has the functions, or 4 has not.")
END
done
