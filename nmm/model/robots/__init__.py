"""What a robot is, its kinematics at a configuration, and (`loading`) how a file becomes one."""
