"""Differentiable functions of (t, q): tasks, references, objectives, and how a list of them runs."""
