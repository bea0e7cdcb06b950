"""What you bring: a policy of Stable-Baselines3 that was trained in a plain simulator, into mine.zip.

    python examples/bring/train.py 30000

and your own loop, which goes on in the simulator that a run has grounded, into better.zip:

    python examples/bring/train.py 20000 mine
"""

import sys
from pathlib import Path

import yaml
from stable_baselines3 import PPO

import gsl

CONF = Path(__file__).parent / "my_conf"
OWN = {"config_dir": CONF, "trust": "examples.bring.mark"}


def main(steps: int, run: str | None = None) -> None:
    """Train, or go on training."""
    wiring = yaml.safe_load((CONF / "policy/mine.yaml").read_text())["wiring"]
    world = None if run else gsl.make_world("plain_pendulum", **OWN)
    env = gsl.grounded_env(run, world=world, task=gsl.make_task("mark", **OWN), wiring=wiring)
    if run:
        model = PPO.load("mine.zip", env=env)
    else:
        network = {"net_arch": [32, 32], "log_std_init": -1.0}
        model = PPO("MlpPolicy", env, n_steps=500, batch_size=100, gamma=0.98, learning_rate=1e-3, seed=1,
                    device="cpu", policy_kwargs=network)  # fmt: skip
    model.learn(steps)
    model.save("better.zip" if run else "mine.zip")


if __name__ == "__main__":
    sys.path.append(".")  # where examples.bring.mark is found
    main(int(sys.argv[1]), *sys.argv[2:])
