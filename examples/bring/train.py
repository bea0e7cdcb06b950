"""What you bring: a trainer, here PPO of Stable-Baselines3, and the policy that it makes in a plain simulator.

    python examples/bring/train.py 120000 --save mine

writes mine.zip, and the same actor as TorchScript, mine.pt. The same trainer goes on in the simulator of a diagnosis:

    python examples/bring/train.py 120000 --from mine --grounded mine --save better
"""

import argparse
import sys
from pathlib import Path

import torch
import yaml
from stable_baselines3 import PPO

import gsl

CONF = Path(__file__).parent / "my_conf"
OWN = {"config_dir": CONF, "trust": "examples.bring.follow"}


def train(steps: int, save: str, start: str | None = None, grounded: str | None = None, seed: int = 1) -> None:
    """Train in the plain simulator or in that of a run, from a policy on or afresh."""
    torch.set_num_threads(1)  # threads cost small networks more than they gain
    wiring = yaml.safe_load((CONF / "policy/mine.yaml").read_text())["wiring"]
    world = None if grounded else gsl.make_world("plain_pendulum", **OWN)
    env = gsl.grounded_env(grounded, world=world, task=gsl.make_task("follow", **OWN), wiring=wiring)
    if start:
        model = PPO.load(start, env=env, seed=seed, device="cpu")
    else:
        network = {"net_arch": [32, 32], "log_std_init": -1.0}
        model = PPO("MlpPolicy", env, n_steps=1000, batch_size=100, gamma=0.98, learning_rate=1e-3, seed=seed,
                    device="cpu", policy_kwargs=network)  # fmt: skip
    model.learn(steps)
    model.save(save)
    actor = [model.policy.mlp_extractor.policy_net, model.policy.action_net, torch.nn.Hardtanh()]
    torch.jit.script(torch.nn.Sequential(*actor)).save(f"{save}.pt")


if __name__ == "__main__":
    sys.path.append(".")  # where examples.bring.follow is found
    parser = argparse.ArgumentParser()
    parser.add_argument("steps", type=int)
    parser.add_argument("--save", required=True, help="name of the files")
    parser.add_argument("--from", dest="start", help="name of a policy to go on with")
    parser.add_argument("--grounded", help="run of gsl diagnose in whose simulator to train")
    parser.add_argument("--seed", type=int, default=1)
    train(**vars(parser.parse_args()))
