"""What a motion asks of the motors and of the ground."""
