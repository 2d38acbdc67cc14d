"""A platform described by its wheels."""
