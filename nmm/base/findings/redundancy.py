"""What a task leaves free, and whether laps round a closed path bring the posture back."""

from collections.abc import Callable


def _many(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def _them(count: int) -> str:
    return "it" if count == 1 else "them"


def _brackets(given: int, withheld: int) -> str:
    if given == withheld:
        return (
            f"but a manoeuvre gives {_them(withheld)}, the task at rest all the while: two motions of the "
            "inputs in turn, there and back (rank of the Lie brackets); so every configuration nearby with "
            "this task value can be reached"
        )
    give = f"give {given} of them" if given else f"do not give {_them(withheld)} either"
    return (
        f"manoeuvres, two motions of the inputs in turn, there and back, {give} (rank of the Lie brackets; "
        "longer manoeuvres were not looked at)"
    )


WORDS: dict[str, str | Callable[..., str]] = {
    # what a task leaves free
    "redundancy_of": lambda robot, rows: f"{robot}, task {', '.join(rows)}",
    "redundancy_sizes": lambda n, following, inputs, rows: (
        f"n = {_many(n, 'coordinate')}{f' (and {following} that follow others)' if following else ''}, "
        f"n_u = {_many(inputs, 'input')}, s = {_many(rows, 'row')} of the task"
    ),
    "static_redundancy": "static redundancy       n - s = {n} - {rows} = {degree} (configurations)",
    "kinematic_redundancy": "kinematic redundancy  n_u - s = {inputs} - {rows} = {degree} (motions)",
    "redundancy_at": lambda q: f"at {', '.join(f'{name} = {value:.4g}' for name, value in q.items())}:",
    "configurations_free": (
        "  rank of ∂f/∂q {rank} of {rows}: configurations with this task value form a manifold of dimension "
        "{dimension}"
    ),
    "motions_free": lambda rank, rows, count: (
        f"  rank of J {rank} of {rows}: {_many(count, 'motion')} of the inputs "
        f"{'leaves' if count == 1 else 'leave'} the task at rest"
    ),
    "singular_inputs": lambda lost: (
        f"  {_many(lost, 'direction')} of the task that the coordinates move {'is' if lost == 1 else 'are'} "
        "moved by no input here: J is singular, ∂f/∂q is not"
    ),
    "self_motions": lambda count: (
        f"the task stays at rest in {'each of these motions' if count > 1 else 'this motion'} "
        f"(--self-motion takes {'their numbers' if count > 1 else 'its number'}):"
    ),
    "self_motion": lambda number, motion, alone, everywhere: (
        f"  {number}  {motion}"
        + (f" (without effect on the task{'' if everywhere else ' here'})" if alone else "")
    ),
    "self_motions_combined": lambda count: (
        "and in their opposites and combinations" if count > 1 else "and in its opposite"
    ),
    "nothing_withheld": "the inputs give every motion of the coordinates that leaves the task at rest",
    "motions_withheld": lambda dimension, count: (
        f"the coordinates could move in {_many(dimension, 'independent way')} with the task at rest; "
        f"the wheels withhold {count} of them, which no input gives:"
    ),
    "motion_withheld": "  - {motion} (q_dot: {coordinates})",
    "manoeuvres": _brackets,
    "no_manoeuvre": lambda free, withheld: (
        f"nor does a manoeuvre give {_them(withheld)} with the task at rest all the while: "
        + (
            "only one motion of the inputs leaves the task at rest, and it only leads there and back"
            if free
            else "no motion of the inputs leaves the task at rest"
        )
    ),
    # laps
    "laps_ended": "ended in lap {lap}: {message}",
    "laps_repeat": "repeats itself: drift {drift:.2g} in the last lap",
    "laps_too_few": ("drift {drift:.2g} in the last lap; expected at least 3 laps to tell whether it falls"),
    "laps_converge": (
        "converges: drift {drift:.2g} in the last lap, {factor:.2g} times that of the lap before"
    ),
    "laps_drift": "drifts: {drift:.2g} in the last lap, {factor:.2g} times that of the lap before",
    "full_turns": lambda turns: (
        f"full turns in the last lap: {', '.join(f'{name} {count:+d}' for name, count in turns.items())}"
    ),
    "first_lap": lambda error, on_path: (
        f"lap 1 begins {'on' if on_path else f'{error:.3g} off'} the path, in the posture given: its drift "
        "holds the transient"
    ),
}
