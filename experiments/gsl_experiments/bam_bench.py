"""bam's simulation of its bench: rows of logs, friction laws and one explicit step a row (see bam.py)."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.robots.pendulum import DUTY_PER_RADIAN

DT = 0.005  # of processed logs [s]
GRAVITY = 9.80665  # [m/s²]
FASTEST = 100.0  # speeds are clipped to it [rad/s]
LOST = 1e3  # error of a replay that diverges [rad]


class Law(NamedTuple):
    """bam's numbers in the kernel's order; a load that acts alike in both directions has both coefficients equal."""

    kt: float
    resistance: float
    armature: float
    offset: float
    delay: float
    base: float
    viscous: float
    motor: float = 0.0
    external: float = 0.0
    stribeck: float = 0.0
    velocity: float = 1.0
    alpha: float = 1.0
    motor_stribeck: float = 0.0
    external_stribeck: float = 0.0
    motor_quad: float = 0.0
    external_quad: float = 0.0


class Logs(NamedTuple):
    """Logs of one bench side by side, n of them, cut to the shortest.

    Attributes:
        goal, position: [rad], shape (n, T).
        speed: At the beginning [rad/s], shape (n,).
        enabled: Whether the torque is on, shape (n, T).
        kp: Firmware gain, shape (n,).
        volts: Of the supply [V], shape (n,).
        inertia: Without the rotor [kg·m²], shape (n,).
        weight: Greatest torque of gravity [N·m], shape (n,).
    """

    goal: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    enabled: np.ndarray
    kp: np.ndarray
    volts: np.ndarray
    inertia: np.ndarray
    weight: np.ndarray

    def take(self, chosen: np.ndarray) -> Logs:
        """Return some of them."""
        return Logs(*(part[chosen] for part in self))


def read_bench(paths: Sequence[Path]) -> Logs:
    """Read raw logs as bam's process.py does, all rows interpolated to the same times."""
    rows = []
    for path in paths:
        log = json.loads(gzip.decompress(path.read_bytes()))
        entries, arm = log["entries"], log.get("arm_mass", 0.0)
        stamps = np.array([entry["timestamp"] for entry in entries])
        at = np.arange(0.0, stamps[-1], DT)
        goal, position, speed, enabled = (
            interpolate(at, stamps, np.array([float(entry[key]) for entry in entries]))
            for key in ("goal_position", "position", "speed", "torque_enable")
        )
        inertia = (log["mass"] + arm / 3.0) * log["length"] ** 2
        weight = (log["mass"] + arm / 2.0) * GRAVITY * log["length"]
        rows.append((goal, position, speed[0], enabled > 0.5, log["kp"], log["vin"], inertia, weight))
    shortest = min(len(row[0]) for row in rows)
    series = [np.array([row[k][:shortest] for row in rows]) for k in (0, 1, 3)]
    single = [np.array([float(row[k]) for row in rows]) for k in (2, 4, 5, 6, 7)]
    return Logs(series[0], series[1], single[0], series[2], *single[1:])


def interpolate(at: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values at other times, on the line through the first two before the first, shape (len(at),)."""
    k = np.clip(np.searchsorted(stamps, at, side="left") - 1, 0, len(stamps) - 2)
    share = (at - stamps[k]) / (stamps[k + 1] - stamps[k])
    return np.asarray(values[k] + share * (values[k + 1] - values[k]))


def to_law(values: Mapping[str, float]) -> Law:
    """Return parameters by bam's names as the kernel has them."""
    both, both_stribeck = (values.get(f"load_friction_{name}", 0.0) for name in ("base", "stribeck"))
    return Law(
        values["kt"], values["R"], values["armature"], values["q_offset"], values["command_delay"],
        values["friction_base"], values["friction_viscous"],
        values.get("load_friction_motor", both), values.get("load_friction_external", both),
        values.get("friction_stribeck", 0.0), values.get("dtheta_stribeck", 1.0), values.get("alpha", 1.0),
        values.get("load_friction_motor_stribeck", both_stribeck),
        values.get("load_friction_external_stribeck", both_stribeck),
        values.get("load_friction_motor_quad", 0.0), values.get("load_friction_external_quad", 0.0),
    )  # fmt: skip


@compile_kernel
def dry_friction(law: Law, motor: float, external: float, v: float) -> float:
    """Return the greatest dry friction [N·m] under torques of the motor and of gravity, at a speed [rad/s]."""
    size = law.base + abs(external * law.external - motor * law.motor)
    at_rest = law.stribeck + abs(external * law.external_stribeck - motor * law.motor_stribeck)
    if np.sign(external) != np.sign(motor):
        if abs(external) < abs(motor):
            at_rest += law.external_quad * external**2
        elif abs(external) > abs(motor):
            at_rest += law.motor_quad * motor**2
    return size if at_rest == 0.0 else size + at_rest * np.exp(-((abs(v) / law.velocity) ** law.alpha))


@compile_kernel
def replay(law: Law, logs: Logs, positions: np.ndarray) -> None:
    """Fill in the open-loop positions of all logs [rad], shape (n, T)."""
    back = int(law.delay / DT)
    part = law.delay / DT - back
    for k in range(logs.goal.shape[0]):
        q, v = logs.position[k, 0], logs.speed[k]
        for t in range(logs.goal.shape[1]):
            positions[k, t] = q
            goal = (1.0 - part) * logs.goal[k, max(t - back, 0)] + part * logs.goal[k, max(t - back - 1, 0)]
            duty = min(1.0, max(-1.0, DUTY_PER_RADIAN * logs.kp[k] * (goal - q)))
            motor = (law.kt * logs.volts[k] * duty - law.kt**2 * v) / law.resistance if logs.enabled[k, t] else 0.0
            external = -logs.weight[k] * np.sin(q + law.offset)
            inertia, net = logs.inertia[k] + law.armature, motor + external
            stopping = inertia / DT * v + net
            most = dry_friction(law, motor, external, v) + law.viscous * abs(v)
            net -= np.sign(stopping) * min(abs(stopping), most)
            v = min(FASTEST, max(-FASTEST, v + net / inertia * DT))
            q += v * DT + 0.5 * net / inertia * DT**2


def score(law: Law, logs: Logs) -> float:
    """Return the mean absolute error of replays [rad]."""
    positions = np.empty_like(logs.position)
    replay(law, logs, positions)
    error = float(np.abs(positions - logs.position).mean())
    return error if np.isfinite(error) else LOST
