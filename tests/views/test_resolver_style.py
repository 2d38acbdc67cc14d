"""The colours of resolvers: told apart by readers with any colour vision, on a light and on a dark page."""

from __future__ import annotations

import re
from importlib import resources
from itertools import combinations

import numpy as np
import pytest

from nmm.base import kinds
from nmm.base.resolver_style import (
    BLUE,
    GREEN,
    OF_RUNS,
    PINK,
    VERMILLION,
    looks,
    pretty,
    rate,
    resolver_styles,
)

#: What readers without one kind of cone see, in linear sRGB, row by row: Machado, Oliveira and Fernandes,
#: "A Physiologically-based Model for Simulation of Color Vision Deficiency", IEEE TVCG 15(6), 2009, at 1.
PROTANOPIA = [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998]
DEUTERANOPIA = [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.01182, 0.04294, 0.968881]
TRITANOPIA = [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.3039]
VISIONS = {
    "all cones": np.eye(3),
    "protanopia": np.reshape(PROTANOPIA, (3, 3)),
    "deuteranopia": np.reshape(DEUTERANOPIA, (3, 3)),
    "tritanopia": np.reshape(TRITANOPIA, (3, 3)),
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
)
WHITE_POINT = np.array([0.95047, 1.0, 1.08883])
#: The plots' ground in the page, light and dark (web/style.css).
GROUNDS = ("#ffffff", "#11161c")


def linear(color: str) -> np.ndarray:
    c = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(color: str, vision: str) -> np.ndarray:
    x = TO_XYZ @ np.clip(VISIONS[vision] @ linear(color), 0.0, 1.0) / WHITE_POINT
    f = np.where(x > (6 / 29) ** 3, np.cbrt(x), x / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """CIEDE2000 (Sharma, Wu and Dalal, 2005)."""
    L1, a1, b1 = one
    L2, a2, b2 = other
    mean = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))
    grown = 1.5 - 0.5 * np.sqrt(mean**7 / (mean**7 + 25.0**7))
    C1, C2 = np.hypot(grown * a1, b1), np.hypot(grown * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, grown * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    dH = 2 * np.sqrt(C1 * C2) * np.sin(np.radians(0.5 * turn))
    L, C, h = 0.5 * (L1 + L2), 0.5 * (C1 + C2), h1 + 0.5 * turn
    waves = ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.2, 4, -63))
    T = 1 + sum(size * np.cos(np.radians(k * h + shift)) for size, k, shift in waves)
    S_L = 1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2)
    S_C, S_H = 1 + 0.045 * C, 1 + 0.015 * C * T
    away = (h % 360 - 275) / 25
    R = -2 * np.sqrt(C**7 / (C**7 + 25.0**7)) * np.sin(np.radians(60 * np.exp(-(away**2))))
    parts = (L2 - L1) / S_L, (C2 - C1) / S_C, dH / S_H
    return float(np.sqrt(parts[0] ** 2 + parts[1] ** 2 + parts[2] ** 2 + R * parts[1] * parts[2]))


def contrast(one: str, other: str) -> float:
    """WCAG 2's, of relative luminances."""
    low, high = sorted(float(TO_XYZ[1] @ linear(color)) for color in (one, other))
    return (high + 0.05) / (low + 0.05)


def test_the_measure_is_ciede2000() -> None:
    # Pairs 1, 7, 17 and 25 of Sharma's test data.
    for one, other, expected in (
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 0, 0), (50, -1, 2), 2.3669),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ):
        assert difference(np.array(one, float), np.array(other, float)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("vision", VISIONS)
def test_colours_of_runs_are_told_apart(vision: str) -> None:
    # A just noticeable difference is about 2.
    for one, other in combinations(OF_RUNS, 2):
        assert difference(lab(one, vision), lab(other, vision)) > 12.0, (one, other)


def test_colours_of_runs_stand_out_from_the_page() -> None:
    # WCAG 2.2, 1.4.11: graphical objects.
    style = resources.files("nmm.views.playback").joinpath("web", "style.css").read_text("utf-8")
    assert tuple(re.findall(r"--plot: (#\w+);", style)) == GROUNDS
    assert min(contrast(color, ground) for color in OF_RUNS for ground in GROUNDS) > 3.0


BUNDLED = {"rg": (BLUE, "-"), "pg": (VERMILLION, "--"), "ej": (GREEN, "-."), "dls": (PINK, ":")}


def test_a_resolver_looks_the_same_everywhere() -> None:
    styles = resolver_styles()
    assert [*styles] == [*kinds.RESOLVERS]
    assert {name: style for name, style in styles.items() if name in BUNDLED} == BUNDLED
    for names in (["pg"], ["rg", "pg"], ["ej", "dls", "pg", "rg"], ["mine", "pg", "another"]):
        for look in looks(names):
            if look.name.lower() in styles:
                assert (look.color, look.dashes) == styles[look.name.lower()]


@pytest.mark.parametrize("count", [6, 12, 24, 40])
def test_further_resolvers_have_looks_of_their_own(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    names = [*BUNDLED, *(f"mine_{k}" for k in range(4, count))]
    registered = dict.fromkeys(names, object)
    monkeypatch.setattr("nmm.base.resolver_style.RESOLVERS", kinds.Kinds("resolver", **registered))
    styles = resolver_styles()
    assert dict([*styles.items()][:4]) == BUNDLED
    assert len({color for color, _ in styles.values()}) == 6
    assert len({*styles.values()}) == min(count, 24)
    assert [(look.color, look.dashes) for look in looks(names)] == [*styles.values()]
    other = looks(["unregistered"])[0]
    assert count >= 24 or (other.color, other.dashes) not in styles.values()


def test_no_two_of_twenty_runs_look_alike() -> None:
    count = 24 - len(kinds.RESOLVERS)  # 20, unless others are registered: they have looks of their own
    for names in (["rg"] * 20, [f"mine {k}" for k in range(20)], [*BUNDLED] * 5):
        found = looks(names[:count])
        assert len({(look.color, look.dashes) for look in found}) == count
        assert len({look.name for look in found}) == count
    assert looks(["rg"])[0].rgb == (0.0, 0x72 / 255, 0xB2 / 255)


def test_symbols_of_inputs() -> None:
    assert [pretty(name) for name in ("theta", "q1", "steering")] == ["θ", "q₁", "steering"]
    assert [rate(name) for name in ("q1", "torso_lift_joint")] == ["q\u0307₁", "rate of torso_lift_joint"]
