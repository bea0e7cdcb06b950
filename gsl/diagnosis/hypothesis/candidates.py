"""Candidates: every effect of the library with everything of it that can be chosen, read from the effects' settings.

A parameter whose documented range holds a value that does nothing is a strength: it is searched from there outwards.
The others (a velocity, say) are shapes: searched over their range. Links, axes and sides are candidates of their own.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from gsl.core.body import Robot, carrier, lump
from gsl.core.setting import Setting, settings_of
from gsl.diagnosis.angles import say
from gsl.diagnosis.settings import GridSettings
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.effects.effect import effect_class, list_documented, names

WIDE = 10.0  # ends of a range of shapes that are further apart, as a factor, are stepped in logarithms
PROBE = 0.1  # share of the range at which an effect that acts in proportion is probed
SLACK = 0.1  # share of a documented range by which a fit of a value near its end may miss it
AND = ", "  # between the joints of a scope that has no word of its own
NEVER_REPLAYED = ("torque_noise",)  # drawn anew in every episode: a replay has none


class Looks(NamedTuple):
    """What a look at the log says of effects that no search over their range would find.

    Attributes:
        fixed: Parameters by effect that are settled from now on.
        starts: Values by effect, of one parameter, from which a fit begins as well.
    """

    fixed: Mapping[str, Mapping[str, float]]
    starts: Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """One effect, what is fixed of it, and what is free.

    Attributes:
        effect: Its name.
        fixed: What was chosen: link, side, and the scope `joints` if it acts on joints.
        free: Names of the parameters to fit.
        neutral: Their values that do nothing (shapes: the middle of the range), shape (p,).
        documented: Lower and upper ends of their documented ranges, shape (2, p).
        bounds: Within which they are fitted, shape (2, p).
        grid: Values for a screening, shape (g, p); none if the log answers in proportion.
        strong: Which of the free parameters are strengths, of which a value does nothing, shape (p,).
        seen: Value of its only parameter that a look at the log proposes; what lies beside it is no better.
    """

    effect: str
    fixed: Mapping[str, Any]
    free: tuple[str, ...]
    neutral: np.ndarray
    documented: np.ndarray
    bounds: np.ndarray
    grid: np.ndarray
    strong: np.ndarray
    seen: float | None = None

    @property
    def key(self) -> tuple[str, str, tuple[str, ...]]:
        """What tells it from the other candidates of a library."""
        return self.effect, repr(self.fixed), self.free

    @property
    def probes(self) -> np.ndarray:
        """Steps of the parameters that show what an effect in proportion does, shape (p,)."""
        return PROBE * (self.documented[1] - self.neutral)

    @property
    def ratios(self) -> np.ndarray:
        """Which parameters are factors, one of which does nothing, or range over several sizes, shape (p,)."""
        lower, upper = self.bounds
        return (lower > 0.0) & ((self.neutral == 1.0) | (upper > WIDE * lower))

    @property
    def wide(self) -> np.ndarray:
        """Which documented ranges are over several sizes: near and half way are meant in factors there, shape (p,)."""
        return _wide(*self.documented)

    @property
    def on_joints(self) -> bool:
        """Whether it has a scope of joints."""
        return "joints" in self.fixed

    @property
    def scope(self) -> str:
        """Where it acts: a link, a word for joints, or joints with commas between."""
        where = self.fixed.get("joints", self.fixed.get("link", ""))
        return where if isinstance(where, str) else AND.join(where)

    def joints(self, robot: Robot) -> list[str]:
        """Return the controlled joints where it acts, none if that is elsewhere."""
        return robot.list_joints(self.fixed["joints"]) if self.on_joints else []

    def say(self, robot: Robot) -> list[tuple[float, str]]:
        """Return what takes each free parameter to what a reader is told, and its unit, see `angles.say`."""
        settings, joints = settings_of(effect_class(self.effect)), self.joints(robot)
        return [say(robot, joints, settings[name].unit) for name in self.free]

    def tell(self, robot: Robot, values: np.ndarray) -> np.ndarray:
        """Return values of the free parameters, shape (..., p), as a reader is told them."""
        return values * [factor for factor, _ in self.say(robot)]

    def on(self, joints: str | Sequence[str]) -> Candidate:
        """Return the same on other joints: a word for some, or a list."""
        return replace(self, fixed={**self.fixed, "joints": joints if isinstance(joints, str) else [*joints]})

    def with_start(self, value: float | None) -> Candidate:
        """Return the same with one more value of its only parameter in the grid."""
        return self if value is None else replace(self, grid=np.vstack([self.grid, [[value]]]), seen=value)

    def up_to(self, most: float) -> Candidate:
        """Return the same with its only parameter below a value."""
        return replace(self, bounds=np.minimum(self.bounds, most), grid=np.unique(np.minimum(self.grid, most), axis=0))

    def entry(self, parameters: np.ndarray) -> dict[str, Any]:
        """Return the parameters of a world's `effects:` entry."""
        return {**self.fixed, **dict(zip(self.free, parameters.tolist(), strict=True))}

    def claims_its_name(self, parameters: np.ndarray) -> bool:
        """Whether the parameters are inside their documented range, as far as a fit can tell."""
        wide = self.wide
        values, (lower, upper) = (
            np.where(wide, np.log(np.where(wide, x, 1.0)), x) for x in (parameters, self.documented)
        )
        slack = SLACK * (upper - lower)
        return bool(((values >= lower - slack) & (values <= upper + slack)).all())

    def towards(self, end: np.ndarray, share: float) -> np.ndarray:
        """Return the parameters a share of the way from doing nothing to `end`, shape (p,)."""
        start, wide = self.neutral, self.wide & (self.neutral > 0.0)
        factor = np.where(wide, end, 1.0) / np.where(wide, start, 1.0)
        return np.where(wide, start * factor**share, start + share * (end - start))


def effects_of(chosen: Sequence[Candidate], parameters: Sequence[np.ndarray]) -> Effects:
    """Return the `effects:` mapping of several candidates."""
    effects: dict[str, list[dict[str, Any]]] = {}
    for candidate, values in zip(chosen, parameters, strict=True):
        effects.setdefault(candidate.effect, []).append(candidate.entry(values))
    return effects


def library(
    robot: Robot,
    without: Sequence[str] = (),
    looks: Looks | None = None,
    *,
    dense: bool = False,
    floating: bool = False,
    settings: GridSettings | None = None,
) -> tuple[Candidate, ...]:
    """Return all candidates, those on joints with the scope `all`.

    Args:
        robot: Whose links can be chosen; those that are welded to another one can be pushed only.
        without: Effects that are left out.
        looks: What a look at the log says beforehand.
        floating: Whether the base is loaded, and no limb: their masses are found in the air.
        dense: Whether the grids of the strengths are fine.
        settings: The grids.
    """
    settings, looks = settings or GridSettings(), looks or Looks({}, {})
    shares = settings.dense if dense else settings.one_sided
    moving = [robot.base] if floating else [joint.child for joint in lump(robot).joints]
    pushed = [link for link in robot.links if floating or carrier(robot, link, np.zeros(3))[0] != robot.base]
    return tuple(
        candidate.with_start(looks.starts.get(name))
        for name in names()
        if name not in (*without, *NEVER_REPLAYED)
        for candidate in _candidates(name, robot, (moving, pushed), looks.fixed.get(name, {}), shares, settings)
    )


def _candidates(
    name: str,
    robot: Robot,
    places: tuple[Sequence[str], Sequence[str]],
    fixed: Mapping[str, Any],
    shares: Sequence[float],
    grids: GridSettings,
) -> list[Candidate]:
    target: Any = effect_class(name)
    links = places[target.kind != "body"]
    parameters, hints = list_documented(name, robot), get_type_hints(target)
    choices: list[list[tuple[str, Any]]] = []
    if "joints" in parameters:
        choices.append([("joints", "all")])
    if "link" in parameters:
        choices.append([("link", link) for link in links])
    for field, hint in hints.items():
        if get_origin(hint) is Literal:
            choices.append([(field, value) for value in get_args(hint)])
    ranges = {key: value for key, value in parameters.items() if value.lower is not None and value.upper is not None}
    numbers = {key: value for key, value in ranges.items() if key not in fixed}
    proportional = target.kind in ("body", "environment") and "joints" not in parameters
    strengths = [key for key, value in numbers.items() if value.neutral is not None]
    shapes = [key for key in numbers if key not in strengths]
    together = [tuple(strengths)] if len(strengths) > 1 else []
    alone = [] if proportional and together else [(key,) for key in strengths]
    subsets = alone + together if strengths else [()]
    rest = {key: numbers[key].neutral for key in strengths}
    return [
        _candidate(
            name,
            {**{key: value for key, value in rest.items() if key not in subset}, **fixed, **dict(chosen)},
            {key: numbers[key] for key in (*subset, *shapes)},
            strengths=subset,
            one_sided=shares,
            proportional=proportional,
            grids=grids,
        )
        for subset in subsets
        for chosen in itertools.product(*choices)
    ]


def _candidate(
    name: str,
    fixed: Mapping[str, Any],
    free: Mapping[str, Setting],
    *,
    strengths: Sequence[str],
    one_sided: Sequence[float],
    proportional: bool,
    grids: GridSettings,
) -> Candidate:
    documented = np.array([(span.lower, span.upper) for span in free.values()], dtype=float).T
    neutral = np.array([_start(span) for span in free.values()])
    bounds = np.array([_bounds(span, grids.beyond) for span in free.values()]).T
    shares = (grids.paired, grids.paired) if len(strengths) > 1 else (one_sided, grids.two_sided)
    axes = [_axis(span, shares if key in strengths else None, grids) for key, span in free.items()]
    grid = np.empty((0, len(free))) if proportional else np.array(list(itertools.product(*axes)))
    strong = np.array([key in strengths for key in free], dtype=bool)
    return Candidate(name, fixed, tuple(free), neutral, documented, bounds, grid, strong)


def _wide(lower: Any, upper: Any) -> Any:
    return (lower > 0.0) & (upper > WIDE * lower)


def _start(setting: Setting) -> float:
    assert setting.lower is not None and setting.upper is not None
    return 0.5 * (setting.lower + setting.upper) if setting.neutral is None else setting.neutral


def _bounds(setting: Setting, beyond: float) -> tuple[float, float]:
    neutral, lower, upper = setting.neutral, setting.lower, setting.upper
    assert lower is not None and upper is not None
    if neutral is None:
        return lower, upper
    highest = neutral + beyond * (upper - neutral)
    return (0.5 * lower if lower >= 0.0 else beyond * lower), min(highest, setting.most or highest)


def _axis(setting: Setting, shares: tuple[Sequence[float], Sequence[float]] | None, grids: GridSettings) -> list[float]:
    """Return the grid of one parameter: of a strength by shares of a range to one side or to two, else of a shape."""
    lower, upper = setting.lower, setting.upper
    assert lower is not None and upper is not None
    wide = bool(_wide(lower, upper))
    if shares is None:
        return [lower * (upper / lower) ** share if wide else lower + share * (upper - lower) for share in grids.shapes]
    start = _start(setting)
    ends = [end for end in (lower, upper) if abs(end - start) > 1e-12]
    steps = [(end, share) for end in ends for share in shares[len(ends) - 1]]
    return [
        start * (end / start) ** share if wide and start > 0.0 else start + share * (end - start)
        for end, share in steps
    ]
