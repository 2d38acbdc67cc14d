"""J u = rate and h from functions, then u: the object that users call."""
