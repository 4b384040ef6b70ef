"""An arm on a hinge with a spring between two points, from a file; further keys of the spring may follow."""

ARM = """
title = "Arm under a spring"
[[body]]
name = "arm"
parent = "world"
axis = [0.0, -1.0, 0.0]
mass = 2.0
com = [0.5, 0.0, 0.0]
inertia = [0.0, 0.1, 0.1, 0.0, 0.0, 0.0]
[[frame]]
name = "top"
parent = "world"
xyz = [0.0, 0.0, 0.6]
[[frame]]
name = "eye"
parent = "arm"
xyz = [0.4, 0.0, 0.0]
[[force]]
name = "spring"
kind = "spring_damper"
frames = ["top", "eye"]
stiffness = 10.0
"""
