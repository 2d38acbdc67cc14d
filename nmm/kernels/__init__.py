"""Compiled code: kernels and how they are called, packed arrays, small linear algebra, rotations."""
