"""A custom mechanism: a tree from a URDF text, its loop closed in Python.

A parallelogram lifts a platform: two equal arms on the ground carry a bar, which stays level. A URDF is a tree, so the
bar is attached to the left arm, and a closure pins it to the right one. A spring carries the weight.

Run: python examples/custom_mechanism.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import mbdae

BAR = """
  <link name="{name}">
    <inertial>
      <origin xyz="{half} 0 0"/> <mass value="{mass}"/>
      <inertia ixx="0.001" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <origin xyz="{half} 0 0"/> <geometry> <box size="{length} 0.03 0.03"/> </geometry>
    </visual>
  </link>"""
JOINT = """
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/> <child link="{child}"/> <origin xyz="{x} 0 0"/> <axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="0" velocity="0"/>
  </joint>"""


def bar(name: str, length: float, mass: float) -> str:
    """A uniform bar along its x axis, in m and kg."""
    return BAR.format(name=name, half=length / 2, length=length, mass=mass, I=mass * length**2 / 12)


def urdf() -> str:
    """Two arms of 0.4 m on the ground, 0.6 m apart, and a bar of 0.6 m on the left one."""
    links = bar("left_arm", 0.4, 1.0) + bar("right_arm", 0.4, 1.0) + bar("platform", 0.6, 3.0)
    joints = (
        JOINT.format(name="left", parent="ground", child="left_arm", x=0)
        + JOINT.format(name="right", parent="ground", child="right_arm", x=0.6)
        + JOINT.format(name="hinge", parent="left_arm", child="platform", x=0.4)
    )
    return f'<robot name="lift">\n  <link name="ground"/>{links}{joints}\n</robot>'


TABLES = """
title = "Parallelogram lift"
source = { file = "lift.urdf", quiet = true }  # no warning of the limits of its joints
gravity = [0.0, 0.0, -9.81]
[[frame]]
name = "platform_end"
parent = "platform"
xyz = [0.6, 0.0, 0.0]
[[frame]]
name = "right_end"
parent = "right_arm"
xyz = [0.4, 0.0, 0.0]
"""


def main(end: float = 2.0) -> mbdae.Solution:
    """Run the lift, print the tilt of the platform, and return the solution."""
    with TemporaryDirectory() as folder:
        Path(folder, "lift.urdf").write_text(urdf())
        Path(folder, "lift.toml").write_text(TABLES)
        mech = mbdae.load(
            Path(folder, "lift.toml"),
            closures=[mbdae.Closure.revolute("platform_end", "right_end", axis=(0, 1, 0), name="right hinge")],
            forces=[
                mbdae.JointSpring(joint="left", stiffness=60.0, rest=0.5, damping=2.0, name="spring"),
                lambda t, q, v: np.array([4.0 * np.sin(5 * t), 0.0, 0.0]),  # N m on the left arm
            ],
        )
    q, v = mech.assemble(q={"left": 0.5}, guess={"right": 0.5, "hinge": -0.5})
    sol = mbdae.solve(mech, (0, end), q, v, rtol=1e-8)
    print(mbdae.drift(sol))
    angle = {name: sol.signals()[f"q.{name}"] for name in ("left", "hinge")}
    print(f"the platform tilts by at most {np.abs(angle['left'] + angle['hinge']).max():.1e} rad")
    return sol


if __name__ == "__main__":
    main()
