"""Mechanism files in several units, with explicit factors: a press, and a file with keys of every dimension."""

import numpy as np

PRESS = """
[units]
{units}
[[body]]
name = "crank"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = {mass}
com = [0, 0, {com}]
inertia = [{I}, {I}, {I}, 0, 0, 0]
[[body]]
name = "rod"
parent = "crank"
joint = "continuous"
axis = [0, 1, 0]
xyz = [0, 0, {crank}]
mass = {mass}
inertia = [{I}, {I}, {I}, 0, 0, 0]
[[body]]
name = "ram"
parent = "world"
joint = "prismatic"
mass = {mass}
[[frame]]
name = "rod_end"
parent = "rod"
xyz = [0, 0, {rod}]
[[closure]]
kind = "revolute"
frames = ["rod_end", "ram"]
axis = [0, 1, 0]
[[force]]
kind = "joint_damping"
joint = "ram"
damping = {damping}
[[force]]
kind = "joint_spring"
joint = "crank"
stiffness = {spring}
rest = {rest}
[start]
q = {{ crank = {q} }}
v = {{ crank = {v} }}
"""
DEG = 180 / np.pi
SI = {"units": "", "mass": 2.5, "com": 0.05, "I": 4e-3, "crank": 0.1, "rod": 0.4, "damping": 20.0, "spring": 3.0,
      "rest": 0.6, "q": 0.3, "v": 10.0}  # fmt: skip
OTHER_UNITS = {  # the values of SI in other units, with explicit factors
    "mm, deg, kg": {"units": 'length = "mm"\nangle = "deg"\nmass = "kg"', "mass": 2.5, "com": 50, "I": 4000,
                    "crank": 100, "rod": 400, "damping": 0.02, "spring": 3000 / DEG, "rest": 0.6 * DEG, "q": 0.3 * DEG,
                    "v": 10 * DEG},
    "in, g, kN, N m, rpm": {"units": 'length = "in"\nmass = "g"\nforce = "kN"\ntorque = "N m"\nrotation = "rpm"',
                            "mass": 2500, "com": 0.05 / 0.0254, "I": 4 / 0.0254**2, "crank": 0.1 / 0.0254,
                            "rod": 0.4 / 0.0254, "damping": 0.020 * 0.0254, "spring": 3.0, "rest": 0.6, "q": 0.3,
                            "v": 300 / np.pi},
    "ms, N mm": {"units": 'time = "ms"\ntorque = "N mm"', "mass": 2.5, "com": 0.05, "I": 4e-3, "crank": 0.1, "rod": 0.4,
                 "damping": 20e3, "spring": 3000, "rest": 0.6, "q": 0.3, "v": 0.01},
}  # fmt: skip
ALL = """
[[body]]
name = "arm"
parent = "world"
joint = "revolute"
rpy = [0, 0, {a2}]
[[body]]
name = "disc"
parent = "world"
joint = "revolute"
[[body]]
name = "wheel"
parent = "world"
joint = "revolute"
[[body]]
name = "slide"
parent = "world"
joint = "prismatic"
[[body]]
name = "table"
parent = "world"
joint = "planar"
[[closure]]
kind = "coupling"
joints = ["slide", "arm"]
coefficients = [{l1}, {l_a}, {l_aa}]
[[closure]]
kind = "coupling"
joints = ["arm", "slide", "disc"]
coefficients = [{a1}, {a_l}, 3]
[[closure]]
kind = "coupling"
joints = ["slide", "wheel"]
curve = {{ kind = "harmonic", amplitude = {l1}, omega = 2, phase = {a1} }}
[[closure]]
kind = "ratio"
joints = ["arm", "slide"]
coefficients = [{a_l}]
[[closure]]
kind = "point"
name = "pin"
frames = ["arm", "disc"]
[closure.within]
joint = "slide"
windows = [[{l1}, {l2}]]
[[driver]]
joint = "arm"
motion = {{ kind = "polynomial", coefficients = [{a1}, {a1}] }}
[[driver]]
frames = ["arm", "slide"]
motion = {{ kind = "table", points = [[0, {l1}], [1, {l2}]] }}
[[stop]]
joint = "disc"
lower = {a1}
[[clutch]]
joint = "slide"
pitch = {l1}
[[force]]
kind = "joint_pid"
joint = "arm"
reference = {a1}
kp = {e_a}
kd = {e_a}
[[force]]
kind = "joint_pid"
joint = "slide"
controls = "velocity"
reference = {l1}
kp = {f_l}
[[force]]
kind = "dc_motor"
joint = "slide"
voltage = 12
resistance = 2
constant = {e1}
gear = {a_l}
[[force]]
kind = "joint_spring"
joint = "arm"
table = [[{a1}, {e1}], [{a2}, {e2}]]
[[force]]
kind = "coulomb_friction"
closure = "pin"
coefficient = 0.1
radius = {l1}
velocity = {a1}
[[force]]
kind = "bushing"
frames = ["arm", "disc"]
stiffness = [{f_l}, {f_l}, {f_l}, {e_a}, {e_a}, {e_a}]
[[force]]
kind = "wrench"
frame = "arm"
torque = [{e1}, 0, 0]
[[force]]
kind = "joint_torque"
joint = "arm"
torque = {e1}
bias = [{e2}, {e_a}, {e_a}]
[start]
q = {{ arm = {a1}, table = [{l1}, {l2}, 1, 0] }}
v = {{ table = [{l1}, {l2}, {a1}] }}
[order]
q = {{ slide = {l2} }}
[[event]]
name = "swap"
signal = "q.arm > 0.5"
state = {{ "q.disc" = {a1}, "v.slide" = {l1}, "q.wheel" = "2 * q.arm" }}
"""
IN_SI = {"a1": 0.4, "a2": 0.9, "l1": 0.02, "l2": 0.05, "l_a": 0.3, "l_aa": 0.2, "a_l": 40.0, "e1": 0.7, "e2": 0.8,
         "e_a": 6.0, "f_l": 500.0}  # fmt: skip
IN_MM = {"a1": 0.4 * DEG, "a2": 0.9 * DEG, "l1": 20, "l2": 50, "l_a": 300 / DEG, "l_aa": 200 / DEG**2,
         "a_l": 0.04 * DEG, "e1": 700, "e2": 800, "e_a": 6000 / DEG, "f_l": 0.5}  # fmt: skip
