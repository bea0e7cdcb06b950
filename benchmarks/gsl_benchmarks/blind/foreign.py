"""The foreign generator: robots by another hand's servo model at 0.5 ms, with effects built in from their meaning.

Everything between command and gear is `foreign_servo`. What an effect does is written down here once more, from its
meaning, and not taken from gsl/effects. The bodies are moved by gsl's chain model here, which is fast enough to dial
effects, and by MuJoCo in `rigid_mujoco`, which makes the logs; a test holds the two together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.core.plant import Plant
from gsl.worlds.chain import COLUMNS, Chain, accelerate, chain, nothing
from gsl_benchmarks.blind import foreign_servo as servo
from gsl_benchmarks.blind.extras import extra_rows, extra_torque

STEP = 0.0005  # physics period [s]
SETTLE = 0.5  # for which the first command is held before a motion begins [s]
ON_ROTOR = 0.9  # share of the rotor inertia that is on the motor's side of the gear

_ADDED = {  # effect: (its parameter, row)
    "command_latency": ("delay", servo.DELAY),
    "target_smoothing": ("time_constant", servo.SMOOTHING),
    "deadband": ("width", servo.DEADBAND),
    "quantisation": ("step", servo.QUANTUM),
    "coulomb_friction": ("torque", servo.COULOMB),
    "viscous_friction": ("coefficient", servo.VISCOUS),
    "stribeck_friction": ("torque", servo.STRIBECK),
    "load_friction": ("coefficient", servo.LOAD),
    "backlash": ("width", servo.PLAY),
    "joint_compliance": ("compliance", servo.SOFTNESS),
    "duty_loss": ("coefficient", servo.DUTY_LOSS),
    "gain_fade": ("rate", servo.FADE),
    "zero_offset": ("offset", servo.OFFSET),
    "sensor_delay": ("delay", servo.AGE),
}
_FACTORS = {"servo_gain": (("kp", servo.KP), ("kd", servo.KD)), "torque_limit": (("factor", servo.LIMIT),)}


Motion = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""What the encoders read without bias, from rows of servos and extras, their state, rest, commands and start."""


def play_foreign(
    plant: Plant,
    effects: Mapping[str, Any],
    extra: Mapping[str, Any] | None,
    targets: Sequence[np.ndarray],
    starts: Sequence[np.ndarray],
    period: float,
    *,
    embodied: Callable[[Plant, np.ndarray, float], Motion] | None = None,
) -> list[np.ndarray]:
    """Return what the encoders tell before each command and after the last one [rad], shape (T + 1, n_motors) each.

    The arguments are those of `same.play_same`. Then `embodied` makes what moves the bodies, from the plant, the
    armature at its joints [kg·m²] and the control period [s]; the chain model by default.
    """
    rows, bias, armature = build_rows(plant, effects)
    move = (embodied or _in_the_chain)(embody(plant, effects), (1.0 - ON_ROTOR) * armature, period)
    extras, state, rest = extra_rows(plant, extra), np.zeros((2, len(armature))), targets[0][0].copy()
    pairs = zip(targets, starts, strict=True)
    return [move(rows, extras, state, rest, np.ascontiguousarray(path), start) + bias for path, start in pairs]


def _in_the_chain(plant: Plant, armature: np.ndarray, period: float) -> Motion:
    tree = chain(plant, armature)

    def move(
        rows: np.ndarray, extras: np.ndarray, state: np.ndarray, rest: np.ndarray, path: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        said = np.full((len(path) + 1, len(start)), np.nan)
        _play(rows, tree, extras, state, rest, path, np.array([start, np.zeros_like(start)]), period, said)
        return said

    return move


def build_rows(plant: Plant, effects: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the servos' rows, shape (24, n), the log's bias [rad] and the rotors' whole inertia [kg·m²], (n,) each."""
    own, voltage = plant.servo, plant.robot.supply_voltage
    rows = np.array([
        own.kp, own.kd, own.limit, own.no_load_speed, own.coulomb, own.viscous, own.stribeck, own.stribeck_velocity,
        own.load_friction, own.armature, own.delay, own.smoothing, own.quantum, own.deadband, own.play, own.compliance,
        own.supply_resistance / voltage, own.duty_loss, own.fade, own.offset, own.sensor_delay, own.lower_stop,
        own.upper_stop, 1.0 / own.torque_constant,
    ])  # fmt: skip
    bias = plant.sensors.bias.copy()
    for name, entry in _entries(effects):
        mask = plant.mask(entry.get("joints", "all"))
        if name in _ADDED:
            key, row = _ADDED[name]
            rows[row, mask] += entry[key]
        for key, row in _FACTORS.get(name, ()):
            rows[row, mask] *= entry.get(key, 1.0)
        if name == "stribeck_friction":
            rows[servo.STRIBECK_SPEED, mask] = entry["velocity"]
        if name == "supply_sag":
            rows[servo.SAG, mask] += entry["resistance"] / voltage
        if name == "armature":
            rows[servo.ROTOR, mask] += entry["inertia"]
        if name == "sensor_bias":
            bias[mask] += entry["bias"]
        if name == "joint_limit":
            _narrow(rows, plant, mask, entry)
    armature = rows[servo.ROTOR].copy()
    rows[servo.ROTOR] *= ON_ROTOR
    return rows, bias, armature


def _narrow(rows: np.ndarray, plant: Plant, mask: np.ndarray, entry: Mapping[str, Any]) -> None:
    for k in np.flatnonzero(mask):
        joint = plant.robot.joint(plant.robot.motors[k])
        if entry["side"] != "upper":
            rows[servo.LOWER, k] = joint.lower + entry["reduction"]
        if entry["side"] != "lower":
            rows[servo.UPPER, k] = joint.upper - entry["reduction"]


def embody(plant: Plant, effects: Mapping[str, Any]) -> Plant:
    """Return the plant with the links and the gravity that effects give it."""
    for name, entry in _entries(effects):
        links = dict(plant.robot.links)
        if name == "link_mass":
            link = links[entry["link"]]
            share = (link.mass + entry["mass"]) / link.mass
            links[link.name] = replace(link, mass=link.mass + entry["mass"], inertia=share * link.inertia)
        if name == "centre_of_mass":
            link, shift = links[entry["link"]], [entry.get(axis, 0.0) for axis in "xyz"]
            links[link.name] = replace(link, com=link.com + np.array(shift))
        if name == "gravity_tilt":
            plant = replace(plant, gravity=_tilt(plant.gravity, entry.get("roll", 0.0), entry.get("pitch", 0.0)))
        plant = replace(plant, robot=replace(plant.robot, links=links))
    return plant


def _tilt(gravity: np.ndarray, roll: float, pitch: float) -> np.ndarray:
    """Turn gravity about x, then about y."""
    x, y, z = gravity
    y, z = y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)
    return np.array([x * np.cos(pitch) + z * np.sin(pitch), y, z * np.cos(pitch) - x * np.sin(pitch)])


def _entries(effects: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    listed = ((name, entry if isinstance(entry, list | tuple) else [entry]) for name, entry in effects.items())
    return [(name, entry) for name, entries in listed for entry in entries]


@compile_kernel
def _play(
    p: np.ndarray, tree: Chain, rows: np.ndarray, extras: np.ndarray, rest: np.ndarray, path: np.ndarray,
    motion: np.ndarray, period: float, said: np.ndarray,
) -> None:  # fmt: skip
    n = motion.shape[1]
    torque, work, matrix, pushed = np.zeros(n), np.zeros((n, COLUMNS)), np.zeros((n, n)), nothing()
    state, ring, wanted = np.zeros((7, n)), np.zeros((servo.REMEMBERED, 2, n)), np.zeros(n)
    state[servo.ANGLE], state[servo.FILTERED] = motion[0], path[0]
    ring[:, 0] = motion[0]
    settling, ticks = round(SETTLE / STEP), round(period / STEP)
    for count in range(settling + len(path) * ticks):
        since = (count - settling) * STEP
        if count >= settling and (count - settling) % ticks == 0:
            note(p, ring, count, motion, said, (count - settling) // ticks)
        delay_commands(p, path, since, period, wanted)
        servo.foreign_torque(p, state, ring, count, motion, wanted, since, STEP, torque)
        extra_torque(rows, extras, rest, motion, state[servo.MOTOR], STEP, torque)
        accelerate(tree, motion, pushed, torque, work, matrix)
        for i in range(n):
            motion[1, i] += STEP * torque[i]
            motion[0, i] += STEP * motion[1, i]
    note(p, ring, settling + len(path) * ticks, motion, said, len(path))


@compile_kernel
def delay_commands(p: np.ndarray, path: np.ndarray, since: float, period: float, wanted: np.ndarray) -> None:
    """Fill `wanted` [rad], shape (n_motors,), with the late commands that act from a time [s] on."""
    for i in range(len(wanted)):
        wanted[i] = _average(path, i, (since - p[servo.DELAY, i]) / period, STEP / period)


@compile_kernel
def note(p: np.ndarray, ring: np.ndarray, count: int, motion: np.ndarray, said: np.ndarray, row: int) -> None:
    """Write what the encoders read at a physics step into a row of `said` [rad], shape (T + 1, n_motors)."""
    for i in range(motion.shape[1]):
        said[row, i] = servo.measure_late(p, ring, count, motion, i, STEP)[0]


@compile_kernel
def _average(path: np.ndarray, i: int, begin: float, length: float) -> float:
    """Return the mean of the held commands from a time on, for a while, both in control periods."""
    first, last = int(np.floor(begin + 1e-9)), int(np.floor(begin + length - 1e-9))
    old, new = path[min(max(first, 0), len(path) - 1), i], path[min(max(last, 0), len(path) - 1), i]
    share = (begin + length - last) / length if last > first else 0.0
    return (1.0 - share) * old + share * new
