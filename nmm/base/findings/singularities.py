"""Where J loses rank, at a configuration or along a run, what restores it, and where resolvers fail."""

from collections.abc import Callable, Sequence
from math import isfinite

from nmm.base.latex import block, minor_name

#: More names than these are counted, not listed.
MOST_NAMES = 4
#: Most partitions that are named; most characters of a list of zero minors.
MOST_BLOCKS, MOST_TEXT = 6, 160

#: Of RG, by whether its partitions are the scenario's own.
_RG = {False: "RG:", True: "RG, with the scenario's partitions:"}


def number_text(value: float | None) -> str:
    if value is None or value != value:
        return "-"
    return f"{value:.4g}" if isfinite(value) else "inf"


def named_or_counted(names: Sequence[str], kind: str, mark: str = ", ") -> str:
    """Joined names, or their number if there are many."""
    return f"{len(names)} {kind}" if len(names) > MOST_NAMES else mark.join(names) or "none"


def _directions(directions: Sequence[str]) -> str:
    return named_or_counted(directions, "directions", "; ")


def _rates(motions: Sequence[tuple[str, float, str, int]], lost: int, more: int) -> str:
    """ "q1 (σ_min +0.76 per rad), q2 (+0.3 per rad)"; of some directions only, how many."""
    parts: list[str] = []
    for name, rate, unit, regained in motions:
        some = 0 < regained < lost
        what = f"{regained} of {lost} directions" if some else f"{rate:+.2g} per {unit}"
        parts.append(f"{name} ({'' if parts or some else 'σ_min '}{what})")
    return ", ".join(parts) + (f" and {more} more" if more > 0 else "")


def _zero_minors(inputs: Sequence[str], others: Sequence[Sequence[str]]) -> str:
    """Those with a zero column in a phrase, then the others."""
    parts = [f"every minor with {' or '.join(inputs)}"] if inputs else []
    if others:
        names = ", ".join(map(minor_name, others))
        parts.append(
            names if len(names) <= MOST_TEXT else f"{len(others)} {'others' if inputs else 'minors'}"
        )
    return f"0: {'; '.join(parts)}"


def _singular_partitions(own: bool, singular: Sequence[Sequence[str]], count: int) -> str:
    """ "RG, with the scenario's partitions: [v, q2] is"."""
    if len(singular) > MOST_BLOCKS:
        return f"{_RG[own]} {len(singular)} of {count} partitions are"
    return f"{_RG[own]} {', '.join(map(block, singular))} {'is' if len(singular) == 1 else 'are'}"


def _best(best: Sequence[str] | None, ratio: float) -> str:
    return f"; best is {block(best)} ({ratio:.3g})" if best else ""


def _dips(dips: Sequence[tuple[float, float, bool]], more: int) -> str:
    parts = [f"{t:.4g} s ({value:.2g}{', an end' if at_end else ''})" for t, value, at_end in dips]
    return ", ".join(parts) + (f" and {more} more times" if more else "")


WORDS: dict[str, str | Callable[..., str]] = {
    # at a configuration
    "sizes_in_length": "singular values count lengths in L = {length:g} m",
    "sizes_mixed": "singular values count 1 m as much as 1 rad; --length L counts lengths in L",
    "inputs_idle_here": "do not move the task here: {inputs:all}",
    "rank_lost_here": lambda rank, rows, lost: (
        f"Singular: J has rank {rank} of {rows}. No input moves {_directions(lost)}."
    ),
    "nonsingular": "Nonsingular: J has rank {rank}. Weakest is {weakest}, at σ_min = {sigma_min:.4g}.",
    "given_back": lambda directions, too_few: (
        f"The platform gives back what the arm {'has too few joints for' if too_few else 'alone has lost'}: "
        f"{_directions(directions)}."
    ),
    "nothing_given_back": "The platform gives back nothing of what the arm alone has lost.",
    "sigma_constant": "No input changes σ_min to first order.",
    "sigma_changes": lambda motions, more: f"σ_min changes with {_rates(motions, 0, more)}.",
    "sigma_grows": "It grows fastest along {direction} ({rate:+.2g}).",
    "rank_restored": lambda motions, lost, more: f"Comes back with {_rates(motions, lost, more)}.",
    "rank_restored_best": "Best together: {direction} (σ_min {rate:+.2g}).",
    "rank_not_restored": "No input brings it back, to first order.",
    "restored_across": "A motion along {coordinates:all} would, which the wheels do not admit.",
    "all_minors_zero": (
        "{count:plural The only minor is 0.|All {count} minors are 0, and det J Jᵀ with them.}"
    ),
    "some_minors_zero": _zero_minors,
    "minor_squares": ("sum of their squares {squares:.6g}, det J Jᵀ {gram:.6g} (equal: Cauchy-Binet)"),
    "gram": "det J Jᵀ {gram:.6g}, the sum of the squares of all {count} minors",
    "minors_not_listed": lambda first: (
        f"they are not listed: --minors lists all, --minor {','.join(first)} that one"
    ),
    # RG and EJ there
    "rg_kinematic": (
        "The singularity is kinematic, J's own: RG fails with every partition, as other resolvers do."
    ),
    "rg_exhausted": lambda own, singular, count: (
        f"{_singular_partitions(own, singular, count)} singular, algorithmic: J is not, but RG has no other "
        "partition."
    ),
    "rg_algorithmic": lambda own, singular, count, best, ratio: (
        f"{_singular_partitions(own, singular, count)} singular though J is not (algorithmic)"
        f"{_best(best, ratio)}."
    ),
    "rg_regular": lambda own, best=None, ratio=0.0: (
        f"{_RG[own]} no partition is singular here{_best(best, ratio)}."
    ),
    "ej_matrix": lambda added, determinant, rank, count, sigma_min, condition: (
        f"EJ, with the added task {', '.join(added)}: det J_e = {number_text(determinant)}, rank {rank} of "
        f"{count}, σ_min {number_text(sigma_min)}, condition {number_text(condition)}."
    ),
    "ej_kinematic": "J_e is singular because J is: a kinematic singularity.",
    "ej_added_singular": (
        "EJ fails here though J has full rank: the added task's own rows depend on each other."
    ),
    "ej_algorithmic": lambda lost: (
        "An algorithmic singularity: J_e is singular though neither J nor the added task's J_y is. "
        f"Both speak of the same: no input moves {_directions(lost)}."
    ),
    "ej_angle": (
        "|det J_e|/√(det J Jᵀ det J_y J_yᵀ) = {measure:.3g}: 1 where the added task moves only what the task "
        "leaves free, 0 where it asks for what the task fixes."
    ),
    # along a run
    "run_singular": (
        "Singular at {singular} of {samples} samples, the first at {t:g} s: rank {rank} of {rows}."
    ),
    "run_regular": lambda rows, condition, t: (
        f"J has rank {rows} at every sample; its condition is at most {number_text(condition)}, at {t:g} s."
    ),
    "sigma_dips": lambda threshold, dips, more: f"σ_min comes below {threshold:.3g} at {_dips(dips, more)}.",
    "sigma_stays": "σ_min never comes below {threshold:.3g}.",
    "arm_dips": lambda sigma_min, t: (
        f"The arm alone does, down to {number_text(sigma_min)} at {t:g} s: the platform makes up for it."
    ),
    "more_partition_changes": "and {count} more changes",
    "more_crossings": "and {count} more: --json has all, --minor chooses",
    "no_crossing": "No minor changes its sign.",
    "zero_throughout": lambda minors: (
        f"0 on the whole motion: {named_or_counted(list(map(minor_name, minors)), 'minors')}"
    ),
    "minors_not_followed": lambda count, first: (
        f"{count} minors are not looked at: --minors does, --minor {','.join(first)} looks at this one"
    ),
    "ej_sigma": lambda sigma_min, t: f"EJ: σ_min of J_e is at least {number_text(sigma_min)}, at {t:g} s.",
    "ej_dips": lambda threshold, dips, more: f"It comes below {threshold:.3g} at {_dips(dips, more)}.",
    "ej_algorithmic_dips": "J's does not: these are algorithmic, EJ's own.",
}
