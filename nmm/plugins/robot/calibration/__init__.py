"""What a robot's own logs say of it: wheels' radii, track, wheelbase, steering, beside a reference."""
