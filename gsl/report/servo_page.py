"""The page of a learned servo: how near does it bring the simulator to the robot, and what has it learned?"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from gsl.core.plant import Plant
from gsl.core.slides import unit_of_slide
from gsl.models.servo import FACTORS, NUMBERS, ServoModel
from gsl.report.account import servo_table
from gsl.report.charts import Curve, line_chart
from gsl.report.parts import bullets, choice, prose, section, table
from gsl.report.run_page import Answer, budget, write_page
from gsl.report.servo_curves import list_groups, servo_curves_figure
from gsl.report.svg import WIDTH, svg

_DEGREES = 180.0 / np.pi
_NUMBERS: Mapping[str, tuple[str, float]] = {
    "kp": ("kp", 1.0),
    "kd": ("kd", 1.0),
    "limit": ("torque limit", 1.0),
    "delay": ("delay [ms]", 1e3),
    "coulomb": ("Coulomb friction [N·m]", 1.0),
    "viscous": ("viscous friction [N·m·s/rad]", 1.0),
    "deadband": ("dead band [°]", _DEGREES),
    "armature": ("armature [kg·m²]", 1.0),
    "offset": ("offset [°]", _DEGREES),
    "load_friction": ("load friction", 1.0),
    "duty_loss": ("duty loss", 1.0),
}
"""How people are shown each of NUMBERS: its title, and what it is multiplied by."""


def write_servo_page(
    folder: Path,
    metrics: Mapping[str, Any],
    model: ServoModel,
    plant: Plant,
    period: float,
    way: Sequence[float],
    *,
    spent: Sequence[tuple[str, str]],
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        metrics: Of the training.
        model: What was learned.
        plant: The simulator's servos.
        period: Control period of the log [s].
        way: What the motions that say when to stop leave after each iteration [noise floors], NaN where not measured.
        spent: Real data, in words.
    """
    before, after, step, problems = (metrics[key] for key in ("floors_before", "floors_after", "step", "problems"))
    sentence = f"On held-out motions the learned servo takes the gap from {before:.1f} to {after:.2f} noise floors."
    more = ["At 1 noise floor the simulator is as near as the log's own noise can tell."]
    if walks := metrics.get("walks"):
        more.append(f"On held-out walks it goes from {walks['floors_before']:.1f} to {walks['floors_after']:.2f}.")
    titles, rows = servo_table(metrics)
    pictures = {
        model.groups[g]: svg(servo_curves_figure(plant, model, step, period, [g], width=WIDTH), "curves of the servo")
        for g in list_groups(plant, model)
    }
    sections = [
        section(
            "Distance from held-out motions, in noise floors",
            table(titles, rows),
            bullets([prose(f"{line[:1].upper()}{line[1:]}.") for line in problems]),
        ),
        section("What the servo has learned", choice("joints", pictures), note=_CURVES),
        section("Numbers that it has learned", _numbers(model, plant.robot.slides), note=_CHANGES),
        section("Training", _training(way), note=_TRAINING),
        budget(spent),
    ]
    question = "How near does a learned servo bring the simulator to the robot?"
    write_page(folder, Answer(question, sentence, not problems and after <= 1.0, more), sections)


_CURVES = "Above, how a joint answers a step of its command. Below, what constant speed costs: friction and damping."
_CHANGES = "A factor (×) is on the simulator's own value, any other number is added to it. Law and lag stand on top."
_TRAINING = "Half of the held-out motions say when to stop. The figures above are of the other half."


def _numbers(model: ServoModel, slides: Collection[str]) -> Markup | None:
    """Return the numbers of each motor that has learned some; only numbers that changed anywhere have a column."""
    changed = [name for name in NUMBERS if model.numbers[name].any()]
    if not changed:
        return None
    rows = [
        [joint, *(_say(name, model.numbers[name][k], slides=joint in slides) for name in changed)]
        for k, joint in enumerate(model.joints)
    ]
    return table(["joint", *(_title(name, slides=bool(slides)) for name in changed)], rows)


def _title(name: str, *, slides: bool) -> str:
    unit = _NUMBERS[name][0].partition("[")[2].rstrip("]")
    own = unit_of_slide(unit.replace("°", "mm"))
    return f"{_NUMBERS[name][0]}, [{own}]" if slides and own != unit else _NUMBERS[name][0]


def _say(name: str, value: float, *, slides: bool) -> str:
    if name in FACTORS:
        return f"× {np.exp(value):.2f}"
    factor = _NUMBERS[name][1]
    return f"{(1e3 if slides and factor == _DEGREES else factor) * value:+.3g}".replace("-", "−")


def _training(way: Sequence[float]) -> Markup | None:
    measured = [(float(step), level) for step, level in enumerate(way, 1) if np.isfinite(level)]
    if len(measured) < 2:
        return None
    steps, levels = zip(*measured, strict=True)
    curve = Curve("motions that say when to stop", "after", steps, levels)
    return line_chart([curve], x="iteration", y="distance [noise floors]", zero=True, counted=True)
