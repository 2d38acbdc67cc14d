"""Many robots at once: different starts, noise, delays, slip."""
