"""What to say of a learned servo: whether one should search with it, and what a user should know."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.core.servo_law import LAG, LAGS
from gsl.worlds.servo_state import COMMANDS

NEAR, FARTHEST = 1.0, 3.0  # noise floors: up to the first it is as good as the log can tell, beyond the second useless
EXACT = 1.5  # noise floors that a simulator without a gap may be off: up to 1.45 on forty short logs
PERIOD = 0.005  # of control [s], of which servos remember as much as the law sees
COARSE = 0.0025  # physics period [s] above which joints of a NAO leave the replay (docs/results/speed.md)


def problems(metrics: Mapping[str, Any]) -> list[str]:
    """Return why nothing should be searched with a learned servo, if there is a reason.

    Args:
        metrics: Of its artifact.
    """
    after, before, step = metrics["floors_after"], metrics["floors_before"], metrics.get("step", 0.0)
    if after > FARTHEST:
        coarse = f"; physics at {1e3 * step:g} ms are too coarse for it: try sim.step=0.002" if step > COARSE else ""
        return [
            f"held out, the learned servo is {after:.1f} noise floors from the log, more than {FARTHEST:g}{coarse}; "
            "tolerance= of train-servo says what does not matter"
        ]
    if after > max(before, EXACT):
        return [f"held out, the gap is {after:.2f} noise floors, {before:.2f} without"]
    if after > EXACT and not metrics["learned"]:
        return [f"nothing was learned: held out, the gap stays at {after:.1f} noise floors"]
    if metrics["learned"] and not metrics["whole_motions"]:
        return ["the log is one motion, of which parts are held out: of other motions it says nothing"]
    return []


def problems_of_members(metrics: Mapping[str, Any]) -> list[str]:
    """Return why nothing should be searched with all members of a learned servo, if there is a reason.

    Args:
        metrics: Of its artifact.
    """
    most = min(FARTHEST, max(NEAR, metrics["floors_before"]))
    return [
        f"held out, member {k} is {floors:.1f} noise floors from the log, more than {most:.2g}"
        for k, floors in enumerate(metrics["members"])
        if k and floors > most
    ]


def remarks(metrics: Mapping[str, Any]) -> list[str]:
    """Return what a user should know of a learned servo: how near it is, and which groups keep their old servo."""
    after = metrics["floors_after"]
    remarks = (
        [] if after <= NEAR else [f"held out, the learned servo is {after:.1f} noise floors from the log, not within 1"]
    )
    remembered, seen = (COMMANDS - 1) * metrics.get("period", np.inf), LAG * (LAGS - 1)
    if remembered < seen:
        back = f"servos remember {1e3 * remembered:g} ms of commands at the log's rate, the law sees {1e3 * seen:g} ms"
        remarks.append(f"{back}: gsl import mapping.period={PERIOD:g} resamples the log")
    for name, group in metrics["groups"].items():
        if group["floors_after"] > FARTHEST >= after:
            floors = f"{group['floors_after']:.1f} noise floors"
            remarks.append(f"{name} are {floors} from the log, more than {FARTHEST:g}: their loads are not the robot's")
        if not group["learned"]:
            remarks.append(f"{name} keep their servo: nothing that was learned brought held-out motions nearer")
    return remarks
