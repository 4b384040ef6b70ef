"""Machines as MuJoCo models: the same parameters, in MJCF.

Its equality constraints are soft: with a high stiffness and small steps of RK4, errors are 1e-8.
"""

import mujoco
import numpy as np

mujoco.set_mju_user_warning(lambda text: None)  # otherwise warnings go to a file in the working directory
STEP = 2e-4
OPTIONS = f"""<compiler angle="radian"/>
<default><equality solref="{2 * STEP} 1" solimp="0.9999 0.9999 0.001"/></default>
<option timestep="{STEP}" integrator="RK4" gravity="0 0 -9.81" iterations="100" tolerance="1e-14"/>"""

FOUR_BAR = f"""<mujoco>{OPTIONS}<worldbody>
<body><joint name="crank" axis="0 -1 0"/>
  <inertial pos="0.5 0 0" mass="1" diaginertia="1e-9 {1 / 12} {1 / 12}"/>
  <body pos="1 0 0"><joint name="coupler" axis="0 -1 0"/><site name="a" pos="2 0 0"/>
    <inertial pos="1 0 0" mass="2" diaginertia="1e-9 {8 / 12} {8 / 12}"/></body></body>
<body pos="2 0 0"><joint name="rocker" axis="0 -1 0"/><site name="b" pos="1.5 0 0"/>
  <inertial pos="0.75 0 0" mass="1.5" diaginertia="1e-9 {1.5**3 / 12} {1.5**3 / 12}"/></body>
</worldbody><equality><connect site1="a" site2="b"/></equality></mujoco>"""

SLIDER_CRANK = f"""<mujoco>{OPTIONS}<worldbody>
<body><joint name="crank" axis="0 -1 0"/><inertial pos="0 0 0" mass="1.5" diaginertia="0.0063875 0.012675 0.0063875"/>
  <body pos="0.1 0 0"><joint name="crank_pin" axis="0 -1 0"/><site name="a" pos="0.35 0 0"/>
    <inertial pos="0.175 0 0" mass="0.4" diaginertia="4e-5 {0.4 * (0.35**2 + 0.03**2) / 12} 0.0041"/></body></body>
<body><joint name="slider" type="slide" axis="1 0 0"/><site name="b"/>
  <inertial pos="0 0 0" mass="0.6" diaginertia="3e-4 6.5e-4 5e-4"/></body>
</worldbody><equality><connect site1="a" site2="b"/></equality></mujoco>"""


def steps(m, q, v, t, observe):
    """Step a model from (q, v) and return observe(data) at times t, multiples of the step."""
    d = mujoco.MjData(m)
    d.qpos[:], d.qvel[:] = q, v
    mujoco.mj_forward(m, d)
    out = []
    for time in t:
        while d.time < time - 0.5 * m.opt.timestep:
            mujoco.mj_step(m, d)
        out.append(observe(d))
    return np.array(out)


def four_bar(start, t):
    return steps(mujoco.MjModel.from_xml_string(FOUR_BAR), start, np.zeros(3), t, lambda d: d.qpos.copy())


def slider_crank(start, t):
    crank, rod = start[0], start[0] + start[1]
    rod_rate = -0.1 * np.cos(crank) * 6.0 / (0.35 * np.cos(rod))  # of the rod: its end stays on the rail
    slider_speed = -0.1 * np.sin(crank) * 6.0 - 0.35 * np.sin(rod) * rod_rate
    m = mujoco.MjModel.from_xml_string(SLIDER_CRANK)
    return steps(m, start, [6.0, rod_rate - 6.0, slider_speed], t, lambda d: d.qpos.copy())


def double_pendulum(start, t, urdf):
    """Return the URDF file as MuJoCo reads it, without its damping and limits."""
    m = mujoco.MjModel.from_xml_path(str(urdf))
    m.opt.integrator, m.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    m.dof_damping[:] = 0.0
    return steps(m, start, np.zeros(2), t, lambda d: d.qpos.copy())


def stewart_platform(start, t):
    """Return the platform's position and the entries of its rotation matrix, (len(t), 12)."""
    legs = ""
    for i, (foot, _, home, _) in enumerate(start.legs, 1):
        x, y = home[:, 0], home[:, 1]
        legs += f"""<body pos="{text(foot)}" xyaxes="{text(x)} {text(y)}">
          <joint name="x{i}" axis="1 0 0"/><joint name="y{i}" axis="0 1 0"/>
          <inertial pos="0 0 0.2" mass="2" diaginertia="0.03 0.03 0.002"/>
          <body><joint name="piston{i}" type="slide" axis="0 0 1"/><site name="tip{i}" pos="0 0 0.5"/>
            <inertial pos="0 0 0.3" mass="1" diaginertia="0.02 0.02 0.0002"/></body></body>"""
    sockets = "".join(f'<site name="socket{i}" pos="{text(s)}"/>' for i, (_, s, _, _) in enumerate(start.legs, 1))
    joints = "".join(f'<connect site1="tip{i}" site2="socket{i}"/>' for i in range(1, 7))
    m = mujoco.MjModel.from_xml_string(
        f"""<mujoco>{OPTIONS}<worldbody>{legs}<body name="platform"><freejoint/>{sockets}
        <inertial pos="0 0 0" mass="20" diaginertia="0.5 0.5 0.9"/></body></worldbody>
        <equality>{joints}</equality></mujoco>"""
    )
    phase = np.array([leg[3] for leg in start.legs])

    def drive(m, d):
        angle = np.pi * d.time + phase
        lag = 0.28 + 0.06 * np.sin(angle) - d.qpos[2:18:3]
        d.qfrc_applied[2:18:3] = 8000 * lag + 200 * (0.06 * np.pi * np.cos(angle) - d.qvel[2:18:3])

    place, twist = start.bodies["platform"]
    x, y, z, w = start.q[3:7]
    q = [*start.q[7:], *place.translation, w, x, y, z]
    v = [*start.v[6:], *(place.rotation @ twist.linear), *twist.angular]
    mujoco.set_mjcb_control(drive)
    try:
        return steps(m, q, v, t, lambda d: np.concatenate([d.body("platform").xpos, d.body("platform").xmat]))
    finally:
        mujoco.set_mjcb_control(None)


def text(numbers):
    return " ".join(f"{x:.17g}" for x in numbers)
