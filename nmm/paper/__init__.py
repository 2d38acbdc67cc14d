"""`nmm paper`: the four cases of the paper's section VI, its figures 3 to 10 and one page that holds them.

cases       which scenario and which figures belong to which case
numbers     what both runs of a case came to
claims      what the paper says of a case, held against that
case_run    a case from its scenario to its files
processes   the cases shared out over processes
page        index.html
write       all of it, into a folder that appears whole or not at all
"""

from nmm.paper.results import Claim
from nmm.paper.write import PaperReport, write_paper

__all__ = ["Claim", "PaperReport", "write_paper"]
