"""Tasks that begin and end while the robot moves."""
