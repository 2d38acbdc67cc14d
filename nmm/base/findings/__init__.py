"""Findings as data, and the sentence of each code, which only `str(finding)` makes."""

from nmm.base.findings.finding import Finding, words

__all__ = ["Finding", "words"]
