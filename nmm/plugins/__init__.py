"""What stands above the core, which knows none of it: planning, symbolic, live, robot, sweeps."""
