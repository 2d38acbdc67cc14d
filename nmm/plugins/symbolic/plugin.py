"""The plugin that derives J and its minors as formulas, and searches singular configurations."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "symbolic",
    options={
        "singularities.formulas": "nmm.plugins.symbolic.options:FormulaOptions",
        "singularities.search": "nmm.plugins.symbolic.options:SearchOptions",
    },
    findings=("nmm.plugins.symbolic.findings:WORDS",),
)
