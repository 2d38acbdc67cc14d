"""The plugin that derives J and its minors as formulas, and searches singular configurations."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "symbolic",
    options={
        "singularities.formulas": "nmm.cli.singularity_options:FormulaOptions",
        "singularities.search": "nmm.cli.singularity_options:SearchOptions",
    },
    findings=("nmm.findings.formulas:WORDS",),
)
