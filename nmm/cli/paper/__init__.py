"""`nmm paper`: the four cases of the paper's section VI, its figures 3 to 10 and one page that holds them."""

from nmm.cli.paper.cases import Claim
from nmm.cli.paper.write import PaperReport, write_paper

__all__ = ["Claim", "PaperReport", "write_paper"]
