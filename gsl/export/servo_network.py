"""A learned servo as TorchScript and ONNX, with its numbers and a reference in twenty lines of numpy."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.core.servo import numbers
from gsl.core.servo_law import LAG, LAGS, NOBODY, SIGN, SPEED_UNIT
from gsl.core.slides import unit_of_slide
from gsl.errors import ConfigError
from gsl.export.parts import Export, Simulator, by_joint, unheld
from gsl.storage.documents import pretty
from gsl.worlds.servo import BRISTLE

OPSET = 17
_ANGLE, _SPEED, _TORQUE = (f"[{unit}], of slides [{unit_of_slide(unit)}]" for unit in ("rad", "rad/s", "N·m"))
_REFERENCE = '''"""The servos of {robot} at one physics step, as gsl simulates them. Arrays have an entry a joint."""

import json

import numpy as np
import torch

NUMBERS = json.load(open("{name}_servo.json"))
LAW = torch.jit.load("{name}_servo.pt")
N = {{key: np.array([values[name] for name in NUMBERS["order"]]) for key, values in NUMBERS["joints"].items()}}


def torque(targets, q, v, bristle, dahl, step):
    """targets: what was commanded 0, {lag:g}, ... {last:g} s before (now - delay) [rad], [m], shape ({lags}, n)."""
    errors = targets + N["offset"] - q
    bristle[:] = np.clip(bristle + v * step, -N["bristle"], N["bristle"])
    dahl[:] = np.clip(dahl + v * step, -N["bristle"], N["bristle"])
    inputs = [torch.tensor(part, dtype=torch.float32)[None] for part in (errors.T, v, bristle)]
    drive, output = (part[0].detach().numpy() for part in LAW(*inputs))
    e = errors[0] - np.clip(errors[0], -N["deadband"], N["deadband"])
    u = N["kp"] * e - N["kd"] * v + drive
    line = np.clip(1.0 - np.abs(v) / N["no_load_speed"], 0.0, 1.0)  # where the motor drives; braking has its limit
    high, low = N["limit"] * np.where(v > 0, line, 1.0), -N["limit"] * np.where(v < 0, line, 1.0)
    return np.clip(u, low, high) - N["viscous"] * v - N["coulomb"] * dahl / N["bristle"] + output
'''
HELD = ("kp", "kd", "limit", "no_load_speed", "coulomb", "viscous", "deadband", "offset", "delay", "armature", "law")
UNREACHED = 1e9  # a limit that there is none of, in a JSON file


def export_servo(simulator: Simulator) -> Export:
    """Return the files of a simulator with a learned servo.

    Raises:
        ConfigError: It has none.
    """
    plant = simulator.plant
    if plant.law is None:
        raise ConfigError("world.servo", "is missing; format=servo is for a world with a learned servo")
    name, module = simulator.name, law_module(plant)
    joints = {key: by_joint(plant, np.clip(getattr(plant.servo, key), -UNREACHED, UNREACHED)) for key in numbers()}
    joints["bristle"] = by_joint(plant, BRISTLE * plant.robot.sizes)
    about = {
        "robot": plant.robot.name,
        "order": list(plant.robot.motors),
        "slides": list(plant.robot.slides),  # of these m stands for rad, N for N·m
        "inputs": {"errors": f"(1, n, {LAGS}) {_ANGLE}", "velocity": f"(1, n) {_SPEED}", "bristle": f"(1, n) {_ANGLE}"},
        "outputs": {"drive": f"before the torque limit (1, n) {_TORQUE}", "output": f"behind it (1, n) {_TORQUE}"},
        "lag": LAG,
        "joints": joints,
    }
    reference = _REFERENCE.format(robot=plant.robot.name, name=name, lag=LAG, last=LAG * (LAGS - 1), lags=LAGS)
    files: dict[str, str | bytes] = {
        f"{name}_servo.pt": _torchscript(module),
        f"{name}_servo.json": pretty(about),
        f"{name}_servo_reference.py": reference,
    }
    missing, lacking = unheld(plant, HELD), []
    try:
        files[f"{name}_servo.onnx"] = _onnx(module, len(plant.robot.motors))
    except ImportError as error:
        lacking = ["onnx"]
        missing.append(
            f"the ONNX file, which needs gsl[onnx]: pip install 'gsl[onnx]', and give the same command ({error})"
        )
    return Export(files, missing, lacking)


def law_module(plant: Plant) -> Any:
    """Return the law as a module of torch, all joints at once: see gsl/core/servo_law.py."""
    import torch

    law = plant.law
    assert law is not None, "asked before"
    group = np.maximum(law.group, 0)
    acts = (law.group != NOBODY).astype(float)
    one_of = {key: torch.tensor(getattr(law, key)[group], dtype=torch.float32) for key in law._fields[4:]}
    each = {"stiffness": law.stiffness, "torque": law.torque * acts, "lag": law.lag, "size": plant.robot.sizes}

    class Law(torch.nn.Module):
        stiffness: torch.Tensor
        torque: torch.Tensor
        lag: torch.Tensor
        size: torch.Tensor
        first: torch.Tensor
        first_bias: torch.Tensor
        second: torch.Tensor
        second_bias: torch.Tensor
        last: torch.Tensor
        last_bias: torch.Tensor

        def __init__(self) -> None:
            super().__init__()
            for key, values in {**one_of, **each}.items():
                self.register_buffer(key, torch.as_tensor(values, dtype=torch.float32))

        def act(self, z: torch.Tensor) -> torch.Tensor:
            z = torch.clamp(z, -3.0, 3.0)
            return z * (27.0 + z * z) / (27.0 + 9.0 * z * z)

        def forward(
            self, errors: torch.Tensor, velocity: torch.Tensor, bristle: torch.Tensor
        ) -> tuple[torch.Tensor, torch.Tensor]:
            lagged = errors * self.stiffness[:, None]
            speed, bent = velocity / self.size, bristle / self.size
            others = [speed / SPEED_UNIT, self.act(SIGN * speed), bent / BRISTLE]
            x = torch.cat([lagged, torch.stack(others, dim=-1)], dim=-1)[..., None, :]
            x = self.act(torch.matmul(x, self.first) + self.first_bias[:, None])
            x = self.act(torch.matmul(x, self.second) + self.second_bias[:, None])
            x = (torch.matmul(x, self.last) + self.last_bias[:, None])[..., 0, :]
            drive = x[..., 0] + (self.lag * lagged).sum(dim=-1)
            return self.torque * drive, self.torque * x[..., 1]

    return Law().eval()


def _examples(n: int) -> tuple[Any, ...]:
    import torch

    return torch.zeros(1, n, LAGS), torch.zeros(1, n), torch.zeros(1, n)


def _torchscript(module: Any) -> bytes:
    import torch

    trace: Any = torch.jit.trace
    save: Any = torch.jit.save
    buffer = io.BytesIO()
    with warnings.catch_warnings():  # of torch, which would like torch.export; simulators load TorchScript
        warnings.simplefilter("ignore")
        save(trace(module, _examples(len(module.stiffness))), buffer)
    return buffer.getvalue()


def _onnx(module: Any, n: int) -> bytes:
    import onnx
    import torch

    buffer = io.BytesIO()
    with warnings.catch_warnings():  # of the exporter that needs no further library
        warnings.simplefilter("ignore")
        write: Any = torch.onnx.export
        write(
            module, _examples(n), buffer, input_names=["errors", "velocity", "bristle"],
            output_names=["drive", "output"], opset_version=OPSET, dynamo=False,
        )  # fmt: skip
    onnx.checker.check_model(onnx.load_from_string(buffer.getvalue()))
    return buffer.getvalue()
