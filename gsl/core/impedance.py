"""How a joint answers a load: its stiffness and damping at one frequency, and how much of a gap is handed over.

A load w swings a joint that holds still. With w = Re(W exp(i omega t)) and the deflection q = Re(Q exp(i omega t))

    W / Q = K + i omega D        of a PD servo K = kp - J omega² and D = kd, J the inertia at the joint

Dry friction of size F adds about 4 F / (pi |Q| omega) to D and some per cent to K, if the load is well beyond F.
"""

from __future__ import annotations

import numpy as np

QUANTITIES = {"stiffness": "stiffness [N·m/rad]", "damping": "damping [N·m·s/rad]", "torque": "gives way at [N·m]"}
"""What is said of how joints answer loads, by name in documents."""


def phasors(values: np.ndarray, times: np.ndarray, frequency: float) -> np.ndarray:
    """Return the complex amplitudes A of Re(A exp(i omega t)) in columns, beside an offset and a trend, shape (n,).

    Args:
        values: Measured, shape (T, n).
        times: [s], shape (T,).
        frequency: [Hz].
    """
    phase = 2.0 * np.pi * frequency * times
    columns = np.stack([np.cos(phase), -np.sin(phase), np.ones_like(times), times - times.mean()], axis=1)
    solution = np.linalg.lstsq(columns, values, rcond=None)[0]
    amplitudes: np.ndarray = solution[0] + 1j * solution[1]
    return amplitudes


def impedance(load: np.ndarray, deflection: np.ndarray, times: np.ndarray, frequency: float) -> np.ndarray:
    """Return W / Q of joints [N·m/rad], shape (n,); infinite where nothing moves.

    Args:
        load: On each joint [N·m], shape (T, n).
        deflection: Of each joint, from anywhere [rad], shape (T, n).
        times: [s], shape (T,).
        frequency: [Hz].
    """
    swing = phasors(deflection, times, frequency)
    moved = swing != 0.0
    return np.where(moved, phasors(load, times, frequency) / np.where(moved, swing, 1.0), np.inf)


def compute_transfer(sim: np.ndarray, grounded: np.ndarray, real: np.ndarray, noise: np.ndarray) -> float | None:
    """Return the share of the way from `sim` to `real` that `grounded` goes; None where there is no gap.

        sum s (sim - grounded) / sum s (sim - real)        s = sign(sim - real), over joints that differ

    A ratio of sums: a joint with a small gap weighs little. The signs keep gaps of both directions from cancelling.
    Joints that go too far make up for others that stay behind; see `closed`.

    Args:
        sim: Of each joint, shape (n,), as for what follows.
        grounded: The same of the grounded simulator.
        real: The same of the real robot.
        noise: Difference that may be due to the measurement.
    """
    gap = sim - real
    differs = np.isfinite(grounded) & np.isfinite(gap) & (np.abs(gap) > noise)
    if not differs.any():
        return None
    way = np.sign(gap) * (sim - grounded)
    return float(way[differs].sum() / np.abs(gap)[differs].sum())


def compute_closure(sim: np.ndarray, grounded: np.ndarray, real: np.ndarray, noise: np.ndarray) -> float | None:
    """Return the share of the gap that is closed, joint by joint; None where there is none, below 0 where it grows.

        1 - sum |grounded - real| / sum |sim - real|        over joints that differ, of real or complex values

    Args:
        sim: Of each joint, shape (n,), as for what follows.
        grounded: The same of the grounded simulator.
        real: The same of the real robot.
        noise: Difference that may be due to the measurement.
    """
    gap, left = np.abs(sim - real), np.abs(grounded - real)
    differs = np.isfinite(left) & np.isfinite(gap) & (gap > noise)
    return float(1.0 - left[differs].sum() / gap[differs].sum()) if differs.any() else None
