"""The independent generator: MuJoCo moves the rigid bodies, the foreign servos drive them.

gsl's own chain model has no part in it: the bodies come from the exported MJCF, inertia and integration are MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.errors import GslError
from gsl.export.mjcf import export_mjcf
from gsl.export.parts import Simulator
from gsl_benchmarks.blind import foreign_servo as servo
from gsl_benchmarks.blind.extras import extra_rows, extra_torque
from gsl_benchmarks.blind.foreign import ON_ROTOR, SETTLE, STEP, build_rows, delay_commands, embody, note


class _Bodies(NamedTuple):
    """MuJoCo's model and data, and where the motors' joints stand in its coordinates, shape (n_motors,)."""

    library: Any
    model: Any
    data: Any
    places: np.ndarray


def play_mujoco(
    plant: Plant,
    effects: Mapping[str, Any],
    extra: Mapping[str, Any] | None,
    targets: Sequence[np.ndarray],
    starts: Sequence[np.ndarray],
    period: float,
) -> list[np.ndarray]:
    """Return what the encoders read before each command and after the last one [rad], shape (T + 1, n_motors) each.

    The arguments are those of `same.play_same`.

    Raises:
        GslError: MuJoCo is not installed.
    """
    rows, bias, armature = build_rows(plant, effects)
    bodies = _build(embody(plant, effects), (1.0 - ON_ROTOR) * armature, period)
    extras, state = extra_rows(plant, extra), np.zeros((2, len(armature)))
    rest, paths = targets[0][0].copy(), []
    for path, start in zip(targets, starts, strict=True):
        paths.append(_play(bodies, rows, extras, state, rest, np.ascontiguousarray(path), start, period) + bias)
    return paths


def _build(plant: Plant, armature: np.ndarray, period: float) -> _Bodies:
    try:
        import mujoco
    except ImportError as error:
        raise GslError("the independent generator needs MuJoCo: pip install 'gsl[mujoco]'") from error
    text = next(iter(export_mjcf(Simulator(plant, STEP, period, floating=False, name="robot")).files.values()))
    model = mujoco.MjModel.from_xml_string(text)
    off = mujoco.mjtDisableBit
    for flag in (off.mjDSBL_CONTACT, off.mjDSBL_LIMIT, off.mjDSBL_FRICTIONLOSS, off.mjDSBL_ACTUATION):
        model.opt.disableflags |= flag  # the servos have all of these
    places = np.array([model.joint(name).dofadr[0] for name in plant.robot.motors])
    model.dof_damping[:] = 0.0
    model.dof_armature[places] = armature
    return _Bodies(mujoco, model, mujoco.MjData(model), places)


def _play(
    bodies: _Bodies, rows: np.ndarray, extras: np.ndarray, heat: np.ndarray, rest: np.ndarray, path: np.ndarray,
    start: np.ndarray, period: float,
) -> np.ndarray:  # fmt: skip
    library, model, data, places = bodies
    n = len(start)
    said, torque, wanted = np.full((len(path) + 1, n), np.nan), np.zeros(n), np.zeros(n)
    state, ring = np.zeros((7, n)), np.zeros((servo.REMEMBERED, 2, n))
    state[servo.ANGLE], state[servo.FILTERED], ring[:, 0] = start, path[0], start
    library.mj_resetData(model, data)
    data.qpos[places] = start  # no free joint: coordinates and speeds have the same places
    motion = np.array([start, np.zeros(n)])
    settling, ticks = round(SETTLE / STEP), round(period / STEP)
    for count in range(settling + len(path) * ticks):
        since = (count - settling) * STEP
        if count >= settling and (count - settling) % ticks == 0:
            note(rows, ring, count, motion, said, (count - settling) // ticks)
        delay_commands(rows, path, since, period, wanted)
        servo.foreign_torque(rows, state, ring, count, motion, wanted, since, STEP, torque)
        extra_torque(extras, heat, rest, motion, state[servo.MOTOR], STEP, torque)
        data.qfrc_applied[places] = torque
        library.mj_step(model, data)
        motion[0], motion[1] = data.qpos[places], data.qvel[places]
    note(rows, ring, settling + len(path) * ticks, motion, said, len(path))
    return said
