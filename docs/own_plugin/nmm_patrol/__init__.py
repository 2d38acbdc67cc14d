"""Rounds from place to place: a plugin of nmm."""
