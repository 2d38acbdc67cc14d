"""Lengths and angles in words."""


def length(value: float) -> str:
    """ "3.04 mm", "1.2 m"."""
    return f"{1e3 * value:.3g} mm" if value < 1.0 else f"{value:.3g} m"


def angle(value: float) -> str:
    """ "4.06 mrad", "1.2 rad"."""
    return f"{1e3 * value:.3g} mrad" if value < 1.0 else f"{value:.3g} rad"
