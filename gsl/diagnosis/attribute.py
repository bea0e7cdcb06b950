"""Attribution: which effects, switched on and fitted on training windows, explain the held-out ones.

Forward selection with a beam over screenings and joint fits, then a drop-one pass: every set of effects competes
against smaller ones on windows that no fit has seen, nuisances refitted for each and their cost counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.diagnosis import nuisance
from gsl.diagnosis.candidates import Candidate, switched_on
from gsl.diagnosis.fit import Build, Fit, projected, refined, sensitivities
from gsl.diagnosis.replay import Bench, Effects
from gsl.diagnosis.residual import loss
from gsl.diagnosis.screen import Ground, Screening, best_of, screened
from gsl.diagnosis.shared import shares

NOISE_COST = 0.96  # robust cost of a residual that is noise and nothing else
WIDTH = 8  # leads that are fitted after a screening
BEAM = 2  # sets of effects that are continued
ROUNDS = 4
FEW = 20  # training windows of which none is left out at a first glance
DOMINANT, LOCAL = 0.25, 2  # share of the excess that makes a joint a suspect, and how many there are at most


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects with everything fitted, and what it costs where it was not fitted.

    Attributes:
        candidates: Its effects; empty for calibration alone.
        parameters: Of each effect.
        fit: On the training windows.
        costs: Robust cost of the held-out residuals of each sample of `Pieces.samples`, shape (n_samples,).
        counts: Residuals in each of these, shape (n_samples,).
        levels: Held-out cost of one residual of each joint, see `Comparison.levels`, shape (n_joints,).
    """

    candidates: tuple[Candidate, ...]
    parameters: tuple[np.ndarray, ...]
    fit: Fit
    costs: np.ndarray
    counts: np.ndarray
    levels: np.ndarray

    @property
    def effects(self) -> Effects:
        """As a world's `effects:` mapping."""
        return switched_on(self.candidates, self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of selection."""
        return tuple(candidate.effect for candidate in self.candidates)

    @property
    def places(self) -> frozenset[tuple[str, str]]:
        """Its effects and where each acts."""
        return frozenset((candidate.effect, candidate.scope) for candidate in self.candidates)

    @property
    def claims_its_names(self) -> bool:
        """Whether all parameters are inside their documented ranges, as far as a fit can tell."""
        return all(one.claims_its_name(values) for one, values in zip(self.candidates, self.parameters, strict=True))

    @property
    def cost(self) -> float:
        """Held-out cost, that of the nuisances included."""
        return float(self.costs.sum()) + self.fit.toll

    @property
    def level(self) -> float:
        """Held-out cost of one residual: about 1 where only noise is left."""
        return float(self.costs.sum() / self.counts.sum())


@dataclass(frozen=True)
class Arena:
    """Where hypotheses compete.

    Attributes:
        train: Windows of the training records.
        held_out: Windows of the others.
        library: The candidates.
        scopes: Names of scopes and their joints, each of shape (n_joints,).
        tick: Called with a phase when it begins, and with an empty word whenever some work is done.
        scouts: Training windows that a screening looks at, spread over all of them; None for half of them.
    """

    train: Bench
    held_out: Bench
    library: tuple[Candidate, ...]
    scopes: Mapping[str, np.ndarray]
    tick: Callable[[str], None]
    scouts: int | None = None

    @property
    def glance(self) -> Bench:
        """The windows of a screening: every second one is enough to see which candidates are worth a fit."""
        count = len(self.train.pieces)
        looked_at = self.scouts or (count // 2 if count > FEW else count)
        spread = np.unique(np.linspace(0, count - 1, min(count, looked_at)).round().astype(int))
        return replace(self.train, pieces=self.train.pieces.chosen(spread))

    @property
    def _torque_unit(self) -> float:
        return self.train.simulator.plant.robot.torque_unit

    def only(self, effects: Sequence[str]) -> Arena:
        """Return the arena with a part of the library."""
        return replace(self, library=tuple(one for one in self.library if one.effect in effects))

    def calibration(self) -> Hypothesis:
        """Return the hypothesis without an effect."""
        return self.fitted((), np.zeros(0), nuisance.none(self.train.joints), every=1, rounds=2 * ROUNDS)

    def fitted(
        self,
        candidates: tuple[Candidate, ...],
        start: np.ndarray,
        at: np.ndarray,
        *,
        every: int = 2,
        rounds: int = ROUNDS,
    ) -> Hypothesis:
        """Fit a set of effects from a start and score it; `every` and `rounds` as in `refined`."""
        sizes = np.cumsum([len(candidate.free) for candidate in candidates])[:-1]

        def parted(values: np.ndarray) -> tuple[np.ndarray, ...]:
            return tuple(np.split(values, sizes)) if candidates else ()

        def build(values: np.ndarray) -> Effects:
            return switched_on(candidates, parted(values))

        bounds = np.hstack([candidate.bounds for candidate in candidates]) if candidates else np.zeros((2, 0))
        ratios = np.concatenate([np.zeros(0, dtype=bool), *(candidate.ratios for candidate in candidates)])
        common = shares(candidates, self.scopes, self._torque_unit) if self.train.simulator.calibrates else ()
        fit = refined(self.train, build, start, bounds, at, ratios=ratios, common=common, every=every, rounds=rounds)
        return self._scored(candidates, parted(fit.parameters), fit, build)

    def _scored(
        self, candidates: tuple[Candidate, ...], parameters: tuple[np.ndarray, ...], fit: Fit, build: Build
    ) -> Hypothesis:
        z = self.held_out.residual(build(fit.parameters), fit.nuisances)
        used, sample = self.held_out.comparison.used(z.shape[1]), self.held_out.pieces.samples
        lost, names = loss(z), np.unique(sample)
        cost = lost.sum(axis=1)
        costs = np.array([cost[sample == name].sum() for name in names])
        counts = np.array([used.sum() * (sample == name).sum() for name in names])
        self.tick("")
        return Hypothesis(candidates, parameters, fit, costs, counts, self.held_out.comparison.levels(lost))

    def ground(self, base: Hypothesis) -> Ground:
        """Return where a screening on top of a hypothesis starts: without its nuisances, which hide what is missing."""
        at, effects, bench = nuisance.none(self.train.joints), base.effects, self.glance
        z = bench.residual(effects, at)
        slopes = sensitivities(bench, effects, at, z)
        best, costs = projected(z, slopes, at, bench.simulator.spread)
        return Ground(effects, at, z, slopes, costs, best)

    def screening(self, base: Hypothesis) -> Screening:
        """Return what each candidate could explain on top of `base`."""
        ground = self.ground(base)
        local = [one.on(joint) for joint in self._dominant(ground) for one in self.library if one.on_joints]
        return screened(self.glance, ground, (*self.library, *local), self.scopes, self.tick)

    def successors(self, base: Hypothesis, width: int = WIDTH) -> tuple[list[Hypothesis], Screening]:
        """Return hypotheses with one effect more than `base`, best first, and the screening that led to them."""
        screening = self.screening(base)
        used = {(candidate.effect, candidate.scope) for candidate in base.candidates}
        leads = [lead for lead in screening.leads if (lead.candidate.effect, lead.candidate.scope) not in used]
        start = np.concatenate([np.zeros(0), *base.parameters])
        found = [
            self.fitted((*base.candidates, lead.candidate), np.r_[start, lead.parameters], lead.nuisances)
            for lead in best_of(leads, width)
        ]
        return sorted(found, key=lambda one: one.cost), screening

    def _dominant(self, ground: Ground) -> list[str]:
        """Return the joints in which most of what calibration leaves lies: there every effect is tried alone."""
        used = self.glance.comparison.used(ground.residual.shape[1]) * len(ground.residual)
        excess = np.maximum(0.0, ground.costs - used)
        order = np.argsort(excess)[::-1][:LOCAL]
        joints = {
            int(np.argmax(mask)): name for name, mask in self.scopes.items() if mask.sum() == 1
        }  # joints are last
        if len(joints) < len(excess):
            return []
        return [joints[k] for k in order if excess[k] > DOMINANT * excess.sum()]


@dataclass(frozen=True)
class Gain:
    """How much less one hypothesis costs than another, over held-out samples.

    Attributes:
        value: In units of cost.
        low: Lower 95 % bound by bootstrap over samples.
        high: Upper bound.
    """

    value: float
    low: float
    high: float


def gain(better: Hypothesis, worse: Hypothesis, *, samples: int = 1000, seed: int = 0) -> Gain:
    """Compare two hypotheses sample by sample; the difference of their nuisances' costs is in every sample."""
    difference = worse.costs - better.costs
    extra = worse.fit.toll - better.fit.toll
    totals = difference[_drawn(len(difference), samples, seed)].sum(axis=1) + extra
    low, high = np.quantile(totals, [0.025, 0.975])
    return Gain(float(difference.sum() + extra), float(low), float(high))


def share(
    better: Hypothesis, worse: Hypothesis, none: Hypothesis, least: float, *, samples: int = 1000, seed: int = 0
) -> tuple[float, float, float]:
    """Return a gain as a share of the excess, in [-1, 1], and its 95 % interval by bootstrap over samples.

    Args:
        better: What gains.
        worse: Over which it gains.
        none: What costs the excess: the hypothesis without an effect.
        least: Cost of one residual where only noise is left.
        samples: Of the bootstrap.
        seed: Of the bootstrap.
    """
    index = np.vstack([np.arange(len(none.costs)), _drawn(len(none.costs), samples, seed)])
    gains = (worse.costs - better.costs)[index].sum(axis=1) + worse.fit.toll - better.fit.toll
    excess = (none.costs - least * none.counts)[index].sum(axis=1) + none.fit.toll
    value, *drawn = np.clip(gains / np.maximum(excess, 1e-9), -1.0, 1.0)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(value), float(low), float(high)


def _drawn(count: int, samples: int, seed: int) -> np.ndarray:
    """Return samples with replacement, as indices of shape (samples, count)."""
    return np.random.default_rng(seed).integers(0, count, (samples, count))


def scopes_of(
    groups: Mapping[str, Sequence[str]], joints: Sequence[str], *, apart: bool = True
) -> dict[str, np.ndarray]:
    """Return all joints, the robot's groups and, if joints are `apart`, each joint as scopes: shapes (n_joints,)."""
    single = {joint: (joint,) for joint in joints} if apart else {}
    everything = {"all": tuple(joints), **groups, **single}
    masks = {name: np.array([joint in members for joint in joints]) for name, members in everything.items()}
    return {name: mask for name, mask in masks.items() if mask.any()}
