"""Candidates: every effect of the library with everything of it that can be chosen, read from the effects' settings.

A parameter whose documented range holds a value that does nothing is a strength: it is searched from there outwards.
The others (a velocity, say) are shapes: searched over their range. Links, axes and sides are candidates of their own.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from gsl.core.body import Robot, carrier, lumped
from gsl.core.setting import Setting
from gsl.diagnosis.replay import Effects
from gsl.effects.effect import documented, effect_class, names

ONE_SIDED = (0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)  # shares of the way from doing nothing to the end of the range
DENSE = (0.02, 0.05, 0.1, 0.15, 0.22, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0)  # where joints shake: minima are narrow there
TWO_SIDED = (0.05, 0.15, 0.35, 0.65, 1.0)
PAIRED = (0.2, 0.6)  # where two strengths are searched together
SHAPES = (0.0, 0.3, 1.0)
WIDE = 10.0  # ends of a range of shapes that are further apart, as a factor, are stepped in logarithms
PROBE = 0.1  # share of the range at which an effect that acts in proportion is probed
SLACK = 0.1  # share of a documented range by which a fit of a value near its end may miss it
NEVER_REPLAYED = ("torque_noise",)  # drawn anew in every episode: a replay has none
BEYOND = 1.5  # how far past its documented range a strength is fitted; there it loses its claim to the name


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
        seen: Value of its only parameter that a look at the log found; what lies beside it is no better.
    """

    effect: str
    fixed: Mapping[str, Any]
    free: tuple[str, ...]
    neutral: np.ndarray
    documented: np.ndarray
    bounds: np.ndarray
    grid: np.ndarray
    seen: float | None = None

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
        """Where it acts, in a word."""
        return str(self.fixed.get("joints", self.fixed.get("link", "")))

    def on(self, joints: str) -> Candidate:
        """Return the same on other joints."""
        return replace(self, fixed={**self.fixed, "joints": joints})

    def beginning_at(self, value: float | None) -> Candidate:
        """Return the same with one more value of its only parameter in the grid."""
        return self if value is None else replace(self, grid=np.vstack([self.grid, [[value]]]), seen=value)

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


def switched_on(chosen: Sequence[Candidate], parameters: Sequence[np.ndarray]) -> Effects:
    """Return the `effects:` mapping of several candidates."""
    effects: dict[str, list[dict[str, Any]]] = {}
    for candidate, values in zip(chosen, parameters, strict=True):
        effects.setdefault(candidate.effect, []).append(candidate.entry(values))
    return effects


def library(
    robot: Robot,
    without: Sequence[str] = (),
    known: Mapping[str, Mapping[str, Any]] | None = None,
    starts: Mapping[str, float] | None = None,
    *,
    dense: bool = False,
    floating: bool = False,
) -> tuple[Candidate, ...]:
    """Return all candidates, those on joints with the scope `all`.

    Args:
        robot: Whose links can be chosen; those that are welded to another one can be pushed only.
        without: Effects that are left out.
        known: Values of parameters that a look at the log has found already, by effect.
        starts: And where a fit of effects of one parameter begins as well.
        floating: Whether the base is loaded, and no limb: their masses are found in the air.
        dense: Whether the grids of the strengths are fine.
    """
    shares = DENSE if dense else ONE_SIDED
    moving = [robot.base] if floating else [joint.child for joint in lumped(robot).joints]
    pushed = [link for link in robot.links if floating or carrier(robot, link, np.zeros(3))[0] != robot.base]
    return tuple(
        made.beginning_at((starts or {}).get(name))
        for name in names()
        if name not in (*without, *NEVER_REPLAYED)
        for made in _of(name, robot, (moving, pushed), (known or {}).get(name, {}), shares)
    )


def _of(
    name: str,
    robot: Robot,
    places: tuple[Sequence[str], Sequence[str]],
    given: Mapping[str, Any],
    shares: Sequence[float],
) -> list[Candidate]:
    target: Any = effect_class(name)
    links = places[target.kind != "body"]
    known, hints = documented(name, robot), get_type_hints(target)
    choices: list[list[tuple[str, Any]]] = []
    if "joints" in known:
        choices.append([("joints", "all")])
    if "link" in known:
        choices.append([("link", link) for link in links])
    for field, hint in hints.items():
        if get_origin(hint) is Literal:
            choices.append([(field, value) for value in get_args(hint)])
    ranges = {key: value for key, value in known.items() if value.lower is not None and value.upper is not None}
    numbers = {key: value for key, value in ranges.items() if key not in given}
    proportional = target.kind in ("body", "environment") and "joints" not in known
    strengths = [key for key, value in numbers.items() if value.neutral is not None]
    shapes = [key for key in numbers if key not in strengths]
    together = [tuple(strengths)] if len(strengths) > 1 else []
    alone = [] if proportional and together else [(key,) for key in strengths]
    subsets = alone + together if strengths else [()]
    rest = {key: numbers[key].neutral for key in strengths}
    return [
        _candidate(
            name,
            {**{key: value for key, value in rest.items() if key not in subset}, **given, **dict(chosen)},
            {key: numbers[key] for key in (*subset, *shapes)},
            strengths=subset,
            one_sided=shares,
            proportional=proportional,
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
) -> Candidate:
    documented = np.array([(known.lower, known.upper) for known in free.values()], dtype=float).T
    neutral = np.array([_start(known) for known in free.values()])
    bounds = np.array([_bounds(known) for known in free.values()]).T
    shares = (PAIRED, PAIRED) if len(strengths) > 1 else (one_sided, TWO_SIDED)
    axes = [_axis(known, shares, strength=key in strengths) for key, known in free.items()]
    grid = np.empty((0, len(free))) if proportional else np.array(list(itertools.product(*axes)))
    return Candidate(name, fixed, tuple(free), neutral, documented, bounds, grid)


def _wide(lower: Any, upper: Any) -> Any:
    return (lower > 0.0) & (upper > WIDE * lower)


def _start(setting: Setting) -> float:
    assert setting.lower is not None and setting.upper is not None
    return 0.5 * (setting.lower + setting.upper) if setting.neutral is None else setting.neutral


def _bounds(setting: Setting) -> tuple[float, float]:
    neutral, lower, upper = setting.neutral, setting.lower, setting.upper
    assert lower is not None and upper is not None
    if neutral is None:
        return lower, upper
    highest = neutral + BEYOND * (upper - neutral)
    return (0.5 * lower if lower >= 0.0 else BEYOND * lower), min(highest, setting.most or highest)


def _axis(setting: Setting, shares: tuple[Sequence[float], Sequence[float]], *, strength: bool) -> list[float]:
    lower, upper = setting.lower, setting.upper
    assert lower is not None and upper is not None
    wide = bool(_wide(lower, upper))
    if not strength:
        return [lower * (upper / lower) ** share if wide else lower + share * (upper - lower) for share in SHAPES]
    start = _start(setting)
    ends = [end for end in (lower, upper) if abs(end - start) > 1e-12]
    steps = [(end, share) for end in ends for share in shares[len(ends) - 1]]
    return [
        start * (end / start) ** share if wide and start > 0.0 else start + share * (end - start)
        for end, share in steps
    ]
