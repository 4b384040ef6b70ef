"""A mechanism as an environment for reinforcement learning: a simulator behind gymnasium's interface.

A force pushes the cart; the pole hangs at the start, and the reward is to swing it up. An action is held for 20 ms; a
saved state of the simulator is the reset. Any mechanism with inputs is wrapped like this; observations are signals.

Run: pip install ".[gym]", python examples/gym_cart_pole.py
"""

from typing import Any

import gymnasium
import numpy as np
import pinocchio as pin

import mbdae
from mbdae.mechanism.forces.joint_torque import JointTorque
from mbdae.mechanism.time_functions.input_functions import Input

PUSH, PERIOD, TRACK = 20.0, 0.02, 2.0  # N, s, m


def cart_pole() -> mbdae.Mechanism:
    """Return a cart of 1 kg with a pole of 0.1 kg and 1 m, which is upright at a = 0."""
    model, here = pin.Model(), pin.SE3.Identity()
    cart = model.addJoint(0, pin.JointModelPX(), here, "cart")
    model.appendBodyToJoint(cart, pin.Inertia.FromBox(1.0, 0.3, 0.2, 0.1), here)
    pole = model.addJoint(cart, pin.JointModelRY(), here, "pole")
    rod = pin.Inertia(0.1, np.array([0.0, 0.0, 0.5]), np.diag([1.0, 1.0, 0.0]) * 0.1 / 12)
    model.appendBodyToJoint(pole, rod, here)
    return mbdae.Mechanism(model, forces=[JointTorque(joint="cart", torque=Input(name="push", unit="N"))], title="Cart")


class CartPole(gymnasium.Env):
    """Observation [x, sin a, cos a, x', a'], action in [-1, 1] of 20 N, reward the height of the tip in [-1, 1]."""

    def __init__(self) -> None:
        self.simulator = mbdae.Simulator(cart_pole(), q=np.array([0.0, np.pi]), step=PERIOD / 4, record=False)
        self.start = self.simulator.save()
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        most = np.array([2 * TRACK, 1.0, 1.0, 100.0, 100.0], np.float32)
        self.observation_space = gymnasium.spaces.Box(-most, most)

    def observe(self) -> np.ndarray:
        """Return the observation now."""
        x, angle, speed, rate = self.simulator.signals("q.cart", "q.pole", "v.cart", "v.pole")
        return np.array([x, np.sin(angle), np.cos(angle), speed, rate], np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Return to the start, with a random push over the first period."""
        super().reset(seed=seed)
        self.simulator.restore(self.start)
        self.simulator["push"] = float(self.np_random.uniform(-1, 1))
        self.simulator.advance(PERIOD)
        return self.observe(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Hold an action for a period; the episode ends at the end of the track, or after 10 s."""
        self.simulator["push"] = PUSH * float(np.clip(action, -1, 1)[0])
        self.simulator.advance(PERIOD)
        seen = self.observe()
        return seen, float(seen[2]), bool(abs(seen[0]) > TRACK), self.simulator.t > 10.0, {"t": self.simulator.t}


def main(episodes: int = 3, seed: int = 1) -> list[float]:
    """Print and return the sum of rewards of a policy that pumps energy, by episode."""
    env, returns = CartPole(), []
    for k in range(episodes):
        seen, _ = env.reset(seed=seed + k)
        total, done = 0.0, False
        while not done:
            push = np.clip(-0.4 * seen[4] * seen[2] - 0.8 * seen[0] - 0.4 * seen[3], -1, 1)
            seen, reward, ended, truncated, info = env.step(np.array([push], np.float32))
            total, done = total + reward, ended or truncated
        returns.append(total)
        print(f"episode {k + 1}: return {total:.1f}, {info['t']:.2f} s, x = {seen[0]:.2f} m, cos a = {seen[2]:.2f}")
    return returns


if __name__ == "__main__":
    main()
