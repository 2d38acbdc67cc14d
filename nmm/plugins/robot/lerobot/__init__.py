"""LeRobot's data sets, v3.0, without LeRobot: runs as episodes, episodes as runs. It needs pyarrow (the extra
`sweep`)."""
