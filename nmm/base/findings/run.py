"""What a run found: how it ended, why, and warnings; docs/api/findings.md lists the codes."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from nmm.base.errors import few
from nmm.base.findings.finding import Finding, Words
from nmm.base.text_format import apart, counted, listed

#: The line in a run's summary of what its motors and wheels find: nothing that control is to blame for.
MOTORS = "motors"


def line(findings: Sequence[Finding]) -> str:
    """Related findings on one line; their leg, if any, is named once."""
    legs = [finding.where.get("leg") for finding in findings]
    texts = [
        f"{_before(leg) if leg and leg != earlier else ''}{finding}"
        for finding, leg, earlier in zip(findings, legs, [None, *legs], strict=False)
    ]
    if legs and legs[0] and legs[0].get("also"):
        times = listed([f"{t:.4g}" for t in legs[0]["also"]])
        texts.append(f"likewise with the tasks from t = {times} s on")
    return "; ".join(texts)


def _before(leg: Mapping[str, Any]) -> str:
    return f"with {listed(leg['tasks']) or 'no task'} from t = {leg['start']:.4g} to {leg['end']:.4g} s: "


def _replanned(plans: Sequence[Mapping[str, float]], **_: Any) -> str:
    first, last = plans[0], plans[-1]
    when = f"at t = {first['t']:.4g} s"
    if len(plans) > 1:
        when = f"{len(plans)} times from t = {first['t']:.4g} to {last['t']:.4g} s"
    m, rad = (max(plan[unit] for plan in plans) for unit in ("m", "rad"))
    return (
        f"the robot left its plan {when}, by up to {m:.3g} m and {rad:.3g} rad, and went on with another; "
        f"the last one takes {last['duration']:.4g} s"
    )


def _inputs_unmet(
    samples: int, share: float, largest: float, relative: float, t: float, scale: float = 1.0, **of: Any
) -> str:
    whole = f"{100 * relative:.3g} % of it" if relative <= 1.0 else "more than the rate itself"
    limits = of.get("kept", ())
    if scale >= 1.0:
        scaled = ""
    elif limits:
        scaled = f"; under its {' and '.join(limits)} λ falls to {scale:.3g}"
    else:
        scaled = f"; its resolver scales the rate on purpose, down to {scale:.3g} of it"
    if "rows" in of:
        scaled += f"; {of['rows']} rows on {of['inputs']} inputs are done in the least-squares sense"
    return (
        f"the inputs did not do all that the task asked in {counted(samples, 'sample')} "
        f"({100 * share:.3g} %): J u differed from the rate by up to {largest:.3g} "
        f"({whole}), at t = {t:.4g} s{scaled}"
    )


def _above_decay(t: float, initial: float, errors: Sequence[Mapping[str, Any]], end: float, **_: Any) -> str:
    parts = [f"{initial:.3g} at first"]
    for sample in errors:
        when = "at the end" if sample["t"] == end else f"at t = {sample['t']:.4g} s"
        parts.append(f"{sample['error']:.3g} {when} (expected {sample['promised']:.2g})")
    return f"the error left its expected decay at t = {t:.4g} s: {', '.join(parts)}"


def _beyond(row: Mapping[str, Any]) -> str:
    lower = -math.inf if row["lower"] is None else row["lower"]
    upper = math.inf if row["upper"] is None else row["upper"]
    value, least, most = apart(row["value"], lower, upper)
    return f"{row['name']} at {row['t']:.3g} s ({value} {row['unit']}; from {least} to {most})"


def _too_fast(name: str, largest: float, limit: float, unit: str) -> str:
    most, allowed = apart(largest, limit, digits=3)
    return f"{name} ({most} {unit}; at most {allowed})"


def _effort_exceeded(actuator: str, peak: float, effort: float, unit: str, t: float, **_: Any) -> str:
    needed, most = apart(peak, effort, digits=3)
    return f"{actuator} needs {needed} {unit} at t = {t:.4g} s, {100 * peak / effort:.0f} % of its {most}"


def _left_plan(
    m: float, rad: float, tube_m: float, tube_rad: float, t: float, back: float | None, **_: Any
) -> str:
    (far, tube), (turned, tube_turned) = apart(m, tube_m, digits=3), apart(rad, tube_rad, digits=3)
    return (
        f"the robot left its plan from t = {t:.3g} s on, by up to {far} m and {turned} rad (more than {tube} "
        f"m or {tube_turned} rad); {'not back at the end' if back is None else f'back at t = {back:.4g} s'}"
    )


def _start_too_near(
    distance: float, name: str, clearance: float, back: float | None, own: bool = False, **_: Any
) -> str:
    clear, least = apart(clearance, distance)
    return (
        f"the start is nearer than the distance to keep, {least} m: {name}, {clear} m; "
        f"{'not back at the end' if back is None else f'back at t = {back:.3g} s'}"
        f"{_OVERLAP if own and clearance <= 0.0 else ''}"
    )


def _distance_not_kept(distance: float, samples: int, name: str, clearance: float, t: float, **_: Any) -> str:
    clear, least = apart(clearance, distance)
    return (
        f"the distance of {least} m could not be kept in {counted(samples, 'sample')}: {name} came to "
        f"{clear} m at t = {t:.3g} s"
    )


def _degrees(angles: Mapping[str, float], **_: Any) -> str:
    started = [f"{name} at {angle:g} rad ({angle / math.tau:.1f} turns)" for name, angle in angles.items()]
    first = next(iter(angles.values()))
    common = math.gcd(round(first), 180)
    share, over = round(first) // common, 180 // common
    pi = {1: "pi", -1: "-pi"}.get(share, f"{share}*pi") + (f"/{over}" if over > 1 else "")
    return f"the start has {listed(started)}; angles are in rad: {first:g}° is {pi}"


def _tips(
    margin: float | None, edge: Sequence[str], t: float, jumps: Mapping[str, float] | None = None, **_: Any
) -> str:
    text = f"the robot tips at t = {t:.4g} s"
    if margin is None:
        text += ": the ground would have to pull it down"
    else:
        outside = f"{-1e3 * margin:.3g} mm outside the edge from {edge[0]} to {edge[1]}"
        text += f": the zero-moment point is {outside}"
    if not jumps:
        return text
    names = few([f"{name} by {change:.3g}" for name, change in jumps.items()], shown=3)
    return f"{text}; inputs jump there ({names}): limits.acceleration spreads that over time"


#: What helps where two links of the robot touch before it has moved.
_OVERLAP = "; for links that overlap as they are drawn: collisions.ignore (ignore=[(one, other)]), or an SRDF"

WORDS: Mapping[str, Words] = {
    # Ready-made sentences: from a user's function, or a folder older than codes
    "said": "{text}",
    # How a run ended
    "singular": (
        "at t = {t:g} s: {meaning}{undefined:if : {undefined}}{lost:if , and the task asks for what no input "
        "gives: {lost:all}}{level:known ; level {level} ({tasks:and}) asks for what the levels above it "
        "decide; pg and dls damp it there, ej with singular: damped}{platform:if ; {platform}}"
    ),
    "diverged": "at t = {t:g} s the motion has diverged: the {what} are beyond {bound:g}",
    "failed": "{text}",
    "interrupted": "interrupted after {t:g} s of {end:g} s",
    "interrupted_judging": "interrupted while the run was judged",
    "reached": "reached at t = {t:.4g} s",
    "not_reached": "not reached in {within:.4g} s: {m:.3g} m and {rad:.3g} rad are left",
    "nothing_to_reach": "not reached{never:else : no task was active at the end}",
    "task_never_began": (
        "task {task} never began: at the end of the run, {missing:all}{missing:else its conditions did not "
        "hold at one time}"
    ),
    "blocked": "blocked by the distance of {pairs:all}{end:known , from t = {t:.4g} to {end:.4g} s}",
    "wheels_slid": (
        "wheels of the robot's file slid sideways{t:known , most at t = {t:.3g} s}: {speeds:few %s (up to "
        "%.3g m/s)}; is its platform what its wheels allow? (nmm check)"
    ),
    "collided": "{name} ran into each other from t = {t:.3g} s on, by up to {depth:.3g} m",
    # The error against its expected decay, and why
    "promise_left": _above_decay,
    "shorter_dt": "with dt = {shorter:.3g} s in place of {dt:g} s the error decayed as expected when tried",
    "dt_too_long": (
        "{part:if for part of the run }alpha * dt (or K * dt) is too large: at t = {t:.3g} s a mode of the "
        "closed loop decays with {rate:.3g} 1/s, which {method} does not follow with dt = {dt:g} s"
        "{tried:if ; a dt below {tried[dt]:.3g} s follows it (tried from t = {tried[start]:g} to "
        "{tried[end]:g} s)}"
    ),
    "rate_jumps": (
        "the rate that tasks ask for jumps {jumps} times, by up to {size:.3g} (m/s, rad/s), first at "
        "t = {t:.4g} s: the inputs follow it at {servo:g} 1/s, with bounded accelerations"
    ),
    "target_jumps": ("the target moved otherwise than its rate says in {steps} steps, and the error with it"),
    "out_of_reach": (
        "the target of {frame} is out of reach: it is {away:.3g} m {side} {joint}, its links add up to "
        "{length:.3g} m"
    ),
    "stretched": "the arm is stretched: {frame} is {away:.3g} m of {length:.3g} m from {joint}",
    "nothing_gives": "no input gives: {lost:all}",
    "pose_without_feedback": (
        "no smooth feedback brings a {platform} platform to a pose x, y, theta that stands (Brockett 1983); "
        "nmm.Parking (task kind parking) and nmm.plan (scenario key plan) do"
    ),
    "inputs_fell_short": (
        "the inputs did not do all that the task asked ({sigma:known damped: σ {sigma:.2g} is below "
        "{threshold:.2g}}{sigma:unknown clipped, scaled or damped})"
    ),
    "still_moving": (
        "the robot has not come to rest: |{name}| is {mean:.3g} {unit} on average over the last "
        "{duration:.3g} s"
    ),
    "near_singularity": (
        "J is nearly singular at t = {t:.4g} s (condition number {condition:.2g}), nearly lost: {lost}"
    ),
    "singularity_passed": (
        "at t = {t:.4g} s the task error jumped from {before:.3g} to {after:.3g} in one step: a singular "
        "configuration was passed between two samples, lost there: {lost}"
    ),
    "partition_switching": "from there on the partition switched {times} times",
    "inputs_changed": "along that step the inputs changed by {percent:.0f} % of their size",
    "chattering": (
        "the inputs chatter: {input} jumps back and forth between samples {jumps} times from t = {t:.4g} "
        "s to {end:.4g} s, by up to {size:.3g}"
    ),
    "extended_jacobian_crossed": (
        "J_e was singular between t = {steps:all %.4g and %.4g s}{more:if  and in {more} more steps} (its "
        "determinant changes its sign){name:else ; the inputs go on without a jump}{name:if : there {name} "
        "jumps from {before:.3g} to {after:.3g} {unit}, and the motion from there on depends on where the "
        "samples fall; {J_too:if J itself is nearly singular: dls continues}{J_too:else singular: damped "
        "drives through}}"
    ),
    "limits_binding": lambda limits, **_: (
        "limits that bind at λ < 1: "
        + ", ".join(
            f"{f'input {name[2:]}' if name.startswith('u_') else name} ({100 * share:.0f} %)"
            for name, share in limits.items()
        )
    ),
    # Warnings
    "setting_parted": "{text}",
    "python_costs": "{text}",
    "start_outside_limits": (
        "the start is outside limits: {outside:all}; what is outside comes back at {recovery:g} m/s or rad/s"
    ),
    "start_in_degrees": _degrees,
    "idle_inputs": (
        "without effect on task and objective: {inputs:all}; at first order nothing moves "
        "{inputs:plural it|them} (an objective can)"
    ),
    "effort_exceeded": _effort_exceeded,
    "tips": _tips,
    "left_plan": _left_plan,
    "pictures_lost": (
        "{lost} of {taken} pictures did not come or did not show all points, for up to {gap:.3g} s at a time"
    ),
    "replanned": _replanned,
    "not_replanned": (
        "the robot left its plan, and no other was made, {times:count time} from t = {t:.4g} s on: {why}"
    ),
    "plan_cut": "at the end, t = {t:.4g} s, the plan that it followed goes on for {left:.3g} s more",
    "horizon_unsolved": (
        "no motion ahead was found in {samples} of {of} samples, at t = {t:.4g} s first: the robot went on "
        "along the last one, which ends at rest"
    ),
    "no_redundancy": "the task has as many rows as there are inputs: no redundancy is left to resolve",
    "inputs_unmet": _inputs_unmet,
    "moves_otherwise": (
        "{name} moves otherwise than its recorded rate says from t = {t:.4g} s to {end:.4g} s ({moved:.3g} "
        "{unit}/s where {recorded:.3g} {unit}/s is recorded): the inputs jump within the steps; method zoh "
        "shows what a sampled controller does"
    ),
    "partition_singular": (
        "at t = {t:.3g} s the block Ja of [{inputs:all}] became singular and no other candidate was better: "
        "{automatic:if J itself is close to losing rank}{automatic:else give more partitions}"
    ),
    "nearly_singular": (
        "at t = {t:.3g} s the task Jacobian is nearly singular (condition number {condition:.2g}), nearly "
        "lost: {lost}; inputs reach {largest:.3g}"
    ),
    "no_answer": (
        "the resolver had no answer in {samples:count sample}, from t = {t:.3g} s on, {lost_rank:if where J "
        "has lost rank}{lost_rank:else within the limits}: its inputs were those nearest to rest"
    ),
    "limit_contradicted": (
        "the limit of {name} could not be kept with the others in {samples:count sample}, from t = {t:.3g} s "
        "on: its rate was beyond what would keep it by up to {beyond:.3g} {unit}{against:if  (what "
        "contradicts each other: {against:all})}"
    ),
    "coordinates_beyond_limits": lambda coordinates, **_: (
        f"coordinates leave their limits: {', '.join(map(_beyond, coordinates))}"
    ),
    "inputs_beyond_limits": lambda inputs, **_: (
        "inputs exceed their limits: "
        + ", ".join(_too_fast(row["name"], row["largest"], row["limit"], row["unit"]) for row in inputs)
    ),
    "functions_beyond_limits": lambda functions, **_: (
        "limits of functions are broken: "
        + "; ".join(
            f"{_beyond(row)}, by {row['beyond']:.3g} at most, in {row['samples']} of {row['of']} samples"
            for row in functions
        )
    ),
    "backed_off": "the error stalled and the robot backed off, at t = {times:all %.3g s}",
    "added_task_missed": (
        "the added task was not done in {samples:count sample}, from t = {t:.4g} to {end:.4g} s{again:if , "
        "and is done again from there on}: its rate was missed by up to {largest:.3g} {unit}"
    ),
    "distances_note": "{text}",
    "start_too_near": _start_too_near,
    "distance_not_kept": _distance_not_kept,
    "braked": (
        "in {samples:count sample} the inputs went towards braking to keep distances{in_vain:if , {in_vain} "
        "of them in vain}"
    ),
    "turned_back_early": "the self-motion turns back early: {text}",
}
