"""What bounds the inputs: velocities, positions, accelerations, functions of q and distances."""
