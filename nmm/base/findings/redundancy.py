"""What a task leaves free, and whether laps round a closed path bring the posture back."""

from nmm.base.findings.finding import Words


def _brackets(given: int, withheld: int) -> str:
    them = "it" if withheld == 1 else "them"
    if given == withheld:
        return (
            f"but a manoeuvre gives {them}, the task at rest all the while: two motions of the "
            "inputs in turn, there and back (rank of the Lie brackets); so every configuration nearby with "
            "this task value can be reached"
        )
    give = f"give {given} of them" if given else f"do not give {them} either"
    return (
        f"manoeuvres, two motions of the inputs in turn, there and back, {give} (rank of the Lie brackets; "
        "longer manoeuvres were not looked at)"
    )


WORDS: dict[str, Words] = {
    # what a task leaves free
    "redundancy_of": "{robot}, task {rows:all}",
    "redundancy_sizes": (
        "n = {n:many coordinate}{following:if  (and {following} that follow others)}, n_u = {inputs:many "
        "input}, s = {rows:many row} of the task"
    ),
    "static_redundancy": "static redundancy       n - s = {n} - {rows} = {degree} (configurations)",
    "kinematic_redundancy": "kinematic redundancy  n_u - s = {inputs} - {rows} = {degree} (motions)",
    "redundancy_at": "at {q:all %s = %.4g}:",
    "configurations_free": (
        "  rank of ∂f/∂q {rank} of {rows}: configurations with this task value form a manifold of dimension "
        "{dimension}"
    ),
    "motions_free": (
        "  rank of J {rank} of {rows}: {count:many motion} of the inputs {count:plural leaves|leave} the "
        "task at rest"
    ),
    "singular_inputs": (
        "  {lost:many direction} of the task that the coordinates move {lost:plural is|are} moved by no "
        "input here: J is singular, ∂f/∂q is not"
    ),
    "self_motions": (
        "the task stays at rest in {count:plural this motion|each of these motions} (--self-motion takes "
        "{count:plural its number|their numbers}):"
    ),
    "self_motion": "  {number}  {motion}{alone:if  (without effect on the task{everywhere:else  here})}",
    "self_motions_combined": "and in {count:plural its opposite|their opposites and combinations}",
    "nothing_withheld": "the inputs give every motion of the coordinates that leaves the task at rest",
    "motions_withheld": (
        "the coordinates could move in {dimension:many independent way} with the task at rest; the wheels "
        "withhold {count} of them, which no input gives:"
    ),
    "motion_withheld": "  - {motion} (q_dot: {coordinates})",
    "manoeuvres": _brackets,
    "no_manoeuvre": (
        "nor does a manoeuvre give {withheld:plural it|them} with the task at rest all the while: {free:if "
        "only one motion of the inputs leaves the task at rest, and it only leads there and back}{free:else "
        "no motion of the inputs leaves the task at rest}"
    ),
    # laps
    "laps_ended": "ended in lap {lap}: {message}",
    "laps_repeat": "repeats itself: drift {drift:.2g} in the last lap",
    "laps_too_few": "drift {drift:.2g} in the last lap; expected at least 3 laps to tell whether it falls",
    "laps_converge": (
        "converges: drift {drift:.2g} in the last lap, {factor:.2g} times that of the lap before"
    ),
    "laps_drift": "drifts: {drift:.2g} in the last lap, {factor:.2g} times that of the lap before",
    "full_turns": "full turns in the last lap: {turns:all %s %+d}",
    "first_lap": (
        "lap 1 begins {on_path:if on}{on_path:else {error:.3g} off} the path, in the posture given: its "
        "drift holds the transient"
    ),
}
