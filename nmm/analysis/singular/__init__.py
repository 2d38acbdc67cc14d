"""Where J loses rank at a configuration and along a motion, why, and what brings it back."""
