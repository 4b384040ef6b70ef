"""SDF files: one model of links and joints, its poses, inertias, joints and shapes."""
