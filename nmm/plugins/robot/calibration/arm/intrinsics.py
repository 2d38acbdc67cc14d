"""A camera's intrinsics: where points before it are in its picture, with slopes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, counted, positive, scalar, unwritable, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.scenario.document import document_in
from nmm.scenario.plain_data import plain

Distortion = Literal["plumb_bob", "rational_polynomial", "equidistant"]
#: How many coefficients each takes.
COEFFICIENTS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "equidistant": (0, 4)}
#: Other names of the same.
ALIASES = {"fisheye": "equidistant", "rational": "rational_polynomial", "": "plumb_bob"}
LONGEST = 100_000  # bytes of a file


@dataclass(frozen=True, eq=False)
class CameraIntrinsics:
    """Where a camera sees points: pixels u = fx x + cx, v = fy y + cy, with x and y distorted.

    The camera's frame is an optical one (REP-103): z ahead, x to the right, y down.

    Attributes
    ----------
    fx, fy : focal lengths, px; cx, cy : the principal point, px
    distortion : coefficients as ROS and OpenCV have them: k1, k2, p1, p2, k3 of "plumb_bob"; k1, k2, p1, p2,
        k3, k4, k5, k6 of "rational_polynomial"; k1, k2, k3, k4 of "equidistant" (fisheye); none by default
    model : which of these
    width, height : of the picture, px; None where they are not known

    Raises
    ------
    InputError : focal lengths that are not above zero, numbers that are not finite, another model, too many
        or too few coefficients

    Examples
    --------
    >>> camera = nmm.CameraIntrinsics(600, 600, 320, 240, width=640, height=480)
    >>> camera.project([[0.1, 0.0, 1.0], [0.0, 0.0, 2.0]])
    array([[380., 240.],
           [320., 240.]])
    """

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Array = ()  # type: ignore[assignment]  # made an array
    model: Distortion = "plumb_bob"
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        where = "camera"
        model = ALIASES.get(self.model, self.model) if isinstance(self.model, str) else self.model
        expect_known("distortion model", model, get_args(Distortion), where)
        given = vector(self.distortion, None, f"{where}: distortion")
        allowed = COEFFICIENTS[model]
        if len(given) not in allowed and len(given) > allowed[-1] and not given[allowed[-1] :].any():
            given = given[: allowed[-1]]  # OpenCV writes zeros behind them
        expected = f"{' or '.join(map(str, allowed))} coefficients of {model}"
        expect(len(given) in allowed, f"{where}: distortion", expected, len(given))
        for name in ("fx", "fy"):
            object.__setattr__(self, name, positive(getattr(self, name), f"{where}: {name}"))
        for name in ("cx", "cy"):
            object.__setattr__(self, name, scalar(getattr(self, name), f"{where}: {name}"))
        for name in ("width", "height"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, counted(getattr(self, name), f"{where}: {name}"))
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "distortion", unwritable(given))

    @property
    def matrix(self) -> Array:
        """K (3, 3), px."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, points: ArrayLike) -> Array:
        """Pixels u, v (..., 2) of points (..., 3), m, in its optical frame; NaN for those that are not before
        the camera. `InputError` for what are no points."""
        given = array(points, "points")
        expect(given.shape[-1:] == (3,), "points", "points of shape (..., 3), m", given.shape)
        pixels, _ = self.seen(given)
        pixels[given[..., 2] <= 0.0] = np.nan
        return pixels

    def seen(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) of points (..., 3), and their slopes in x, y and z (..., 2, 3), px/m."""
        z = points[..., 2]
        z = np.where(np.abs(z) < 1e-9, 1e-9, z)
        a, b = points[..., 0] / z, points[..., 1] / z
        (x, y), (xa, xb, ya, yb) = (_fisheye if self.model == "equidistant" else _radial)(a, b, self._k)
        pixels = np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=-1)
        rows = [
            [self.fx * xa / z, self.fx * xb / z, -self.fx * (xa * a + xb * b) / z],
            [self.fy * ya / z, self.fy * yb / z, -self.fy * (ya * a + yb * b) / z],
        ]
        return pixels, np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    @property
    def _k(self) -> Array:
        k = np.zeros(8)
        k[: len(self.distortion)] = self.distortion
        return k

    @classmethod
    def load(cls, path: str | Path) -> CameraIntrinsics:
        """The intrinsics in a file of ROS's camera calibration (camera_info.yaml): camera_matrix,
        distortion_model, distortion_coefficients, image_width and image_height.

        Raises
        ------
        InputError : no such file, no YAML, a part that is missing or not as ROS writes it

        Examples
        --------
        >>> text = '''
        ... image_width: 640
        ... image_height: 480
        ... camera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}
        ... distortion_model: plumb_bob
        ... distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 0, 0, 0]}
        ... '''
        >>> with open("camera.yaml", "w") as file:
        ...     _ = file.write(text)
        >>> nmm.CameraIntrinsics.load("camera.yaml").width
        640
        """
        stated = plain(document_in(path, LONGEST).data, str(path))
        K = _data(stated, "camera_matrix", str(path), 9)
        if K[1] != 0.0 or K[3] != 0.0 or not np.array_equal(K[6:], [0.0, 0.0, 1.0]):
            raise InputError(where=f"{path}: camera_matrix", expected="fx, 0, cx, 0, fy, cy, 0, 0, 1", got=K)
        distortion = _data(stated, "distortion_coefficients", str(path), None)
        try:
            return cls(
                float(K[0]),
                float(K[4]),
                float(K[2]),
                float(K[5]),
                distortion,
                stated.get("distortion_model") or "plumb_bob",
                stated.get("image_width"),
                stated.get("image_height"),
            )
        except InputError as error:
            raise error.at(path) from None


def _data(stated: Mapping[str, Any], name: str, where: str, length: int | None) -> Array:
    part = stated.get(name)
    data = part.get("data") if isinstance(part, Mapping) else part
    if data is None:
        raise InputError(where=f"{where}: {name}", expected="data: [...]", got=part)
    return vector(data, length, f"{where}: {name}")


def _radial(a: Array, b: Array, k: Array) -> tuple[tuple[Array, Array], tuple[Array, Array, Array, Array]]:
    """Distorted x and y of normalised a and b, by plumb_bob's and the rational model, and their slopes."""
    k1, k2, p1, p2, k3, k4, k5, k6 = k
    r = a * a + b * b
    above, below = 1.0 + r * (k1 + r * (k2 + r * k3)), 1.0 + r * (k4 + r * (k5 + r * k6))
    d = above / below
    slope = ((k1 + r * (2.0 * k2 + 3.0 * r * k3)) - d * (k4 + r * (2.0 * k5 + 3.0 * r * k6))) / below
    da, db = 2.0 * a * slope, 2.0 * b * slope
    x = a * d + 2.0 * p1 * a * b + p2 * (r + 2.0 * a * a)
    y = b * d + p1 * (r + 2.0 * b * b) + 2.0 * p2 * a * b
    xa = d + a * da + 2.0 * p1 * b + 6.0 * p2 * a
    xb = a * db + 2.0 * p1 * a + 2.0 * p2 * b
    ya = b * da + 2.0 * p1 * a + 2.0 * p2 * b
    yb = d + b * db + 6.0 * p1 * b + 2.0 * p2 * a
    return (x, y), (xa, xb, ya, yb)


def _fisheye(a: Array, b: Array, k: Array) -> tuple[tuple[Array, Array], tuple[Array, Array, Array, Array]]:
    """The same by the equidistant model: θ (1 + k1 θ² + ...) along the direction of (a, b)."""
    r = np.maximum(np.hypot(a, b), 1e-12)
    angle = np.arctan(r)
    s = angle * angle
    of = angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))))
    slope = 1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3])))
    d, along = of / r, slope / (1.0 + r * r)
    by = (along - d) / (r * r)  # of d, over r: d'(r) / r
    return (a * d, b * d), (d + a * a * by, a * b * by, a * b * by, d + b * b * by)
