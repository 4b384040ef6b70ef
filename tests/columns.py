"""Columns of bars on springs, loaded at their tip: buckling and flutter in closed form."""

BAR = """
[[body]]
name = "{name}"
parent = "{parent}"
joint = "revolute"
axis = [0.0, -1.0, 0.0]
xyz = [{foot}, 0.0, 0.0]
mass = {mass}
com = [1.0, 0.0, 0.0]
"""
LOADED = """
[[frame]]
name = "tip"
parent = "{last}"
xyz = [{tip}, 0.0, 0.0]
[[force]]
name = "springs"
kind = "joint_spring"
joint = {joints}
stiffness = {stiffness}
[[force]]
name = "load"
kind = "wrench"
frame = "tip"
axes = "{axes}"
force = [-1.0, 0.0, 0.0]
"""


def column(masses, stiffness, tip=1.0, axes="world"):
    """Return a mechanism file without gravity: bars of 1 m with masses at their ends, the last loaded at its tip."""
    names = list(masses)
    bars = [
        BAR.format(name=name, parent=parent, foot=float(parent != "world"), mass=masses[name])
        for parent, name in zip(["world", *names], names, strict=False)
    ]
    text = "gravity = [0.0, 0.0, 0.0]" + "".join(bars)
    return text + LOADED.format(last=names[-1], tip=tip, joints=names, stiffness=stiffness, axes=axes)
