"""Singular configurations searched for: from many starts, told as families, or the nearest to a given one."""
