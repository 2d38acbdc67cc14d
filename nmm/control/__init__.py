"""From functions to J u = rate and h, and from these to u: the controllers that users call."""
