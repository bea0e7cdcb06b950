"""The independent generator: MuJoCo moves the rigid bodies, the foreign servos drive them.

gsl's own chain model has no part in it: the bodies come from the exported MJCF, inertia and integration are MuJoCo's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.errors import GslError
from gsl.export.mjcf import export_mjcf
from gsl.export.parts import Simulator
from gsl_benchmarks.blind import foreign_servo as servo
from gsl_benchmarks.blind.extras import extra_torque
from gsl_benchmarks.blind.foreign import SETTLE, STEP, Motion, delay_commands, note, play_foreign


def play_mujoco(*arguments: Any) -> list[np.ndarray]:
    """Return what `play_foreign` does with the same arguments, its bodies moved by MuJoCo.

    Raises:
        GslError: MuJoCo is not installed.
    """
    return play_foreign(*arguments, embodied=_in_mujoco)


def _in_mujoco(plant: Plant, armature: np.ndarray, period: float) -> Motion:
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
    data = mujoco.MjData(model)

    def move(
        rows: np.ndarray, extras: np.ndarray, heat: np.ndarray, rest: np.ndarray, path: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        n = len(start)
        said, torque, wanted = np.full((len(path) + 1, n), np.nan), np.zeros(n), np.zeros(n)
        state, ring = np.zeros((7, n)), np.zeros((servo.REMEMBERED, 2, n))
        state[servo.ANGLE], state[servo.FILTERED], ring[:, 0] = start, path[0], start
        mujoco.mj_resetData(model, data)
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
            mujoco.mj_step(model, data)
            motion[0], motion[1] = data.qpos[places], data.qvel[places]
        note(rows, ring, settling + len(path) * ticks, motion, said, len(path))
        return said

    return move
