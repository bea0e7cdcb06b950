"""A cart is to stop at a mark; the real rail is not level, which the simulator does not know.

gsl iterate experiment=gymnasium name=cart optimizer=cma_es optimizer.sigma=0.5 'policy.hidden=[]' \
    sim.env_id=examples.cart:Cart real.env_id=examples.cart:Cart real.kwargs.slope=2
"""

import gymnasium
import numpy as np


class Cart(gymnasium.Env):
    """State: distance to the mark [m] and speed [m/s]; action: motor; reward: minus distance and effort."""

    def __init__(self, slope: float = 0.0) -> None:
        self.slope, self.dt = slope, 0.05  # [m/s²], [s]
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,))
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state, self.steps = np.array([self.np_random.uniform(-0.5, 0.5), 0.0]), 0
        return self.state, {}

    def step(self, action):
        place, speed = self.state
        speed += self.dt * (4.0 * float(action[0]) - 0.5 * speed - self.slope)
        self.state, self.steps = np.array([place + self.dt * speed, speed]), self.steps + 1
        effort = 0.1 * float(action[0]) ** 2
        return self.state, -abs(self.state[0]) - effort, False, self.steps >= 100, {"reward_ctrl": -effort}
