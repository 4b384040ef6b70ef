"""Where mechanisms come from: mechanism files, URDF, robot.yaml, Python, saved runs."""
