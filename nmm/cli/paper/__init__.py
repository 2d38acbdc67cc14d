"""`nmm paper`: the four cases of the paper's section VI, its figures 3 to 10 and one page that holds them."""

from nmm.cli.paper.cases import PaperClaim
from nmm.cli.paper.write import PaperReport, write_paper

__all__ = ["PaperClaim", "PaperReport", "write_paper"]
