"""f, J and its minors as formulas, and what follows from them: where J loses rank, and where it cannot."""

from nmm.analysis.formulas.bounds import Bound, lower_bound, never_zero, vanishing
from nmm.analysis.formulas.claims import Claim, singular_set
from nmm.analysis.formulas.expansion import TooLarge
from nmm.analysis.formulas.from_robot import symbolic
from nmm.analysis.formulas.symbolic_analysis import SymbolicAnalysis

__all__ = [
    "Bound",
    "Claim",
    "SymbolicAnalysis",
    "TooLarge",
    "lower_bound",
    "never_zero",
    "singular_set",
    "symbolic",
    "vanishing",
]
