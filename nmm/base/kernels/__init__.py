"""Compiled code: kernels and their calls, packed records, small linear algebra, rotations."""
