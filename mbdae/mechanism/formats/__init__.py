"""Sources of mechanisms: mechanism files, URDF, MJCF, SDF, robot.yaml, Python, saved runs."""
