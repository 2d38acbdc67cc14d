"""A car whose two front wheels steer, without a joint midway between them, as text."""

from __future__ import annotations

from urdf_parts import joint, link, robot

WHEELBASE, TRACK, RADIUS = 0.7, 0.5, 0.1
#: Of the steering joints, rad and rad/s.
STOP, RATE = 0.8, 3.0
#: Rates of the wheels, rad/s.
SPIN = 15.0


def car(
    *more: str, kingpin: float = 0.2, left: float = STOP, right: float = STOP, front: float = WHEELBASE
) -> str:
    """The car; its steering axes are `kingpin` beside the middle and `front` ahead of the rear axle, m."""

    def turning(name: str, parent: str, xyz: str, axis: str, limit: str, kind: str) -> str:
        body = f'<axis xyz="{axis}"/><limit effort="1" {limit}/>'
        return joint(f"{name}_joint", parent, name, kind, body, f'<origin xyz="{xyz}"/>') + link(name)

    parts = [link("base")]
    for side, sign, stop in (("left", 1, left), ("right", -1, right)):
        beside = sign * TRACK / 2
        parts += [
            turning(
                f"rear_{side}_wheel", "base", f"0 {beside} {RADIUS}", "0 1 0",
                f'velocity="{SPIN}"', "continuous",
            ),
            turning(
                f"{side}_steering", "base", f"{front} {sign * kingpin} {RADIUS}", "0 0 1",
                f'lower="{-stop}" upper="{stop}" velocity="{RATE}"', "revolute",
            ),
            turning(
                f"front_{side}_wheel", f"{side}_steering", f"0 {beside - sign * kingpin} 0", "0 1 0",
                f'velocity="{SPIN}"', "continuous",
            ),
        ]  # fmt: skip
    return robot(*parts, *more, attributes='name="ackermann"')
