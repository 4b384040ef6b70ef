"""A stiff mechanism: half-explicit steps are limited by stability, Radau IIA by accuracy.

The slider of a slider-crank moves in a viscous guide and is connected to a fixed point by a stiff spring-damper with
the data of a flyball governor, K = 8e5 N/m and C = 4e4 N s/m (IFToMM benchmark A05). The slider creeps with a rate of C
/ m, which the step of an explicit method must resolve although the motion is slow.

Run: python examples/stiff.py
"""

from mbdae import JointTorque, SpringDamper, load, solve

METHODS = ("herk5", "pherk5", "radau5")


def main(end: float = 2.0, rtol: float = 1e-5) -> dict[str, dict[str, float]]:
    """Print steps, solves and seconds by method and return them."""
    spring = SpringDamper(frames=("world", "slider_pin"), stiffness=8e5, damping=4e4, length=0.45)
    mech = load("slider_crank", forces=[spring, JointTorque(joint="crank", torque=20.0)])
    q, v = mech.assemble(q={"crank": 0.3}, v={"crank": 0.0})
    out = {}
    print(f"{'method':8s} {'steps':>8s} {'solves':>8s} {'seconds':>8s}  crank at the end")
    for method in METHODS:
        sol = solve(mech, (0, end), q, v, method=method, rtol=rtol, atol=rtol)
        angle = sol.q[-1][mech.joint_names.index("crank")]
        out[method] = {"steps": sol.stats["steps"], "solves": sol.stats["solves"], "crank": float(angle)}
        stats = sol.stats
        work = f"{stats['steps']:8d} {stats['solves']:8d} {stats['seconds']:8.2f}"
        print(f"{method:8s} {work}  {angle:.8f} rad, {sol.status}")
    return out


if __name__ == "__main__":
    main()
