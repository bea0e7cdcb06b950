"""The search for wiring faults: screen the menu, fit leads with physics beside them, keep what physics cannot do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment

from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.log import Cut, cut
from gsl.diagnosis.settings import FloorSettings, LogSettings, SearchSettings
from gsl.diagnosis.wiring.fault import BOTH, Fault, gains, permute, rescale
from gsl.diagnosis.wiring.options import Spread, by_range, by_relation, find_beyond, gain_grid, permutations, timings
from gsl.diagnosis.wiring.outcome import Stand, Wiring
from gsl.diagnosis.wiring.physics import DELAY, KD, KP, Contest, Fit, parameter_bounds
from gsl.errors import GslError

NOISE_COST = SearchSettings.noise_cost
WINDOWS = LogSettings(  # short ones: a log whose rate is four times too high has no longer ones
    warm_up=0.3,
    scored=0.4,
    floor=FloorSettings(rests=10**9, unsteady=np.inf),  # every joint has its own floor
)
EXPLAINED = 1.1  # factor on the cost of noise up to which nothing is left
NEEDED = 1.5  # factor on that by which a log is off without physics beyond what one make differs by
BETTER, MUCH = 0.02, 100.0  # share of the cost, and cost, by which a fault without physics beats physics without it
BAD = 2.0  # floors, above which a joint is worth a question
BAD_ANGLE = 0.004  # and angle [rad]: below, physics of every kind comes to as much
HALF = 0.5  # factor that residuals have to fall by, beside the best physics, for a fault to stand
SHARE = 0.6  # share of the excess that has to go with it
PROMISING = 0.8  # factor on a joint's cost by which a hypothesis has to lower it before it is fitted
ALL = 0.7  # share of the joints in question, from which on a fault of timing is one of all
LEADS = 3  # that are fitted in a round
ROUNDS = 6
EVEN = 1.1  # factor on the cost of what is left within which another kind of fault does as well
MOVES = 0.02  # range of a command [rad], below which a joint shows no timing
LATE = 0.3  # of a row, from which on a delay may be that of a whole row
WHOLE = 0.07  # of a row, by which a delay may be off a whole number of rows: gains of one make shift it by as much
AGREE = 0.1  # of a row, by which delays of the joints may differ then
LARGE = 4.0  # floors, below which friction of real servos, which is more than ours, resembles other gains
LIKE_PHYSICS = ("rate", "hold", "gains")  # faults that friction or a soft servo resembles, unless motions differ


@dataclass(frozen=True)
class Search:
    """A log under search.

    Attributes:
        batch: As mended so far.
        plant: As changed so far.
        step: Its physics period [s].
        floor: Noise floor of the positions [rad], shape (n_joints,).
        excluded: Joints whose signals are known to be wrong.
        tick: Called after every replay.
    """

    batch: Batch
    plant: Plant
    step: float
    floor: np.ndarray
    excluded: frozenset[int]
    tick: Callable[[], None]
    _costs: dict[tuple[str, ...], np.ndarray | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def run(self) -> Wiring:
        """Return all faults that stand."""
        search, stands, doubted = self, list[Stand](), None
        contest = self._contest()
        first = fit = contest.fit()
        for _ in range(ROUNDS):
            stand = search._round(fit) or search._without_physics(fit)
            if stand is None:
                break
            if search._is_doubtful(stand.fault, lone=contest.log.motions == 1):
                doubted = stand.fault
                break
            stands.append(stand)
            search, fit = search._mend(stand.fault), stand.after
        return Wiring(tuple(stands), first, fit, search._rows_late(fit), doubted)

    def _mend(self, fault: Fault) -> Search:
        batch, plant = fault.mend(self.batch), fault.change(self.plant)
        return replace(self, batch=batch, plant=plant, floor=fault.refloor(self.floor))

    @cached_property
    def _log(self) -> Cut:
        return cut(self.batch, self.plant.robot, blocks=True, settings=WINDOWS)

    @cached_property
    def _base(self) -> np.ndarray:
        return self._contest().screen()

    def _contest(self, fault: Fault | None = None) -> Contest:
        mended = self._mend(fault) if fault else self
        log = self._log if mended.batch is self.batch else mended._log  # gains leave rows as they are
        if not len(log.train) or not len(log.held_out):
            raise GslError("too short for a window to fit and one to check")
        return Contest(mended.plant, self.step, log, mended.floor, self.tick)

    def _screen(self, fault: Fault) -> np.ndarray | None:
        if fault.key not in self._costs:
            with suppress(GslError):  # a rate at which no episode is long enough
                self._costs[fault.key] = self._contest(fault).screen()
        return self._costs.setdefault(fault.key, None)

    def _round(self, fit: Fit) -> Stand | None:
        """Return the fault that explains most of what physics leaves, None where none stands."""
        bad = [int(k) for k in np.flatnonzero((fit.rms > BAD) & (fit.angle > BAD_ANGLE)) if k not in self.excluded]
        if not bad:
            return None
        for tier in (self._relations, self._others):  # what does not move as commanded spoils the rest
            leads = sorted(tier(bad, self._base), key=lambda lead: -lead[0])[:LEADS]
            tried = [(fault, self._contest(fault).fit()) for _, fault in leads]
            standing = [(fault, after) for fault, after in tried if _stands(fault, fit, after)]
            if standing := [pair for pair in standing if not self._is_physics(*pair)]:
                return _best(standing, fit)
        return None

    def _rows_late(self, fit: Fit) -> int:
        """Return by how many whole rows all joints' commands act later, 0 if by none or by no whole number."""
        period = self.batch.control_period
        if np.median(fit.parameters[DELAY]) < LATE * period:
            return 0
        precise = self._contest().fit(make=True, late=True)
        delays, clear = precise.parameters[DELAY] / period, precise.rms < BAD
        if clear.sum() < max(1, HALF * len(delays)):
            return 0
        middle = float(np.median(delays[clear]))
        apart = float(np.median(np.abs(delays[clear] - middle)))
        rows = round(middle)
        return rows if rows >= 1 and abs(middle - rows) < WHOLE and apart < AGREE else 0

    def _is_doubtful(self, fault: Fault, *, lone: bool) -> bool:
        """Whether physics of a real servo may do what a fault does: in one motion, or where joints are near anyway."""
        if fault.kind not in LIKE_PHYSICS or lone:
            return fault.kind in LIKE_PHYSICS
        gap = self._contest().fit(make=True).rms[list(fault.joints)]  # but for what robots of one make differ by
        return fault.kind == "gains" and bool(np.sqrt((gap**2).mean()) < LARGE)

    def _is_physics(self, fault: Fault, after: Fit) -> bool:
        """Whether gains are such as the documented range of their effect holds."""
        if fault.kind != "gains":
            return False
        low, high = (bound[[KP, KD]] for bound in parameter_bounds(self.plant))
        factors = np.log(np.array([fault.value["kp"], fault.value["kd"]]))
        own = factors + after.parameters[[KP, KD]][:, list(fault.joints)]
        return bool(((own >= low) & (own <= high)).all(axis=0).mean() >= HALF)

    def _without_physics(self, fit: Fit) -> Stand | None:
        """Return the fault that explains everything with no physics at all, where physics explains nearly as much.

        Free physics of every joint can come near a slower rate or other gains. What needs none of it, and leaves
        nothing, is the simpler explanation.
        """
        contest = self._contest()
        alone = contest.fit(make=True).cost
        off = np.flatnonzero(alone > NEEDED * NOISE_COST).tolist()
        if self.excluded or not off:
            return None
        leads = sorted(self._others(off, self._base), key=lambda lead: -lead[0])[:LEADS]
        moving = np.ptp(np.concatenate([episode.action for episode in self.batch.episodes]), axis=0) > MOVES
        for _, lead in leads:
            own = [k for k in lead.joints if moving[k]] or list(lead.joints)
            if alone[own].mean() <= NEEDED * NOISE_COST:  # what is noise fits another rate, too
                continue
            fault = self._refine(lead)
            after = self._contest(fault).fit(make=True)
            gain = float((fit.cost - after.cost).mean())
            if self._is_physics(fault, after):
                continue
            if after.cost.mean() < EXPLAINED * NOISE_COST and gain > max(
                BETTER * fit.cost.mean(), MUCH / contest.count
            ):
                return Stand(fault, fit, after)
        return None

    def _refine(self, fault: Fault) -> Fault:
        """Return gains as a fit has them, which beside those of the menu are others; any other fault as it is."""
        if fault.kind != "gains":
            return fault
        own = list(fault.joints)
        kp, kd = np.exp(self._contest(fault).fit().parameters[[KP, KD]][:, own])
        return gains(kp * fault.value["kp"], kd * fault.value["kd"], own)

    def _relations(self, bad: Sequence[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        """Yield faults of how positions follow commands, and values beyond the joints' limits, with what they lower."""
        for fault in permutations(self.batch):
            if promising := self._promising(fault, bad, base):
                yield promising[0], fault
        beyond = find_beyond(self.batch, self.plant)
        spreads = [(bad, option) for option in by_relation(self.batch, self.plant)]
        spreads += [([k for k in bad if k in beyond], option) for option in by_range(self.batch, self.plant) if beyond]
        yield from self._spreads(spreads, base)

    def _spreads(
        self, spreads: Sequence[tuple[Sequence[int], Spread]], base: np.ndarray
    ) -> Iterator[tuple[float, Fault]]:
        for joints, spread in spreads:
            fault = spread.fault(joints)
            promising = self._promising(fault, joints, base) if fault else None
            if promising and (chosen := spread.fault(promising[1])):
                yield promising[0], chosen

    def _others(self, bad: Sequence[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        """Yield faults that a replay alone shows, with by how much they lower the cost."""
        yield from self._spreads([(bad, option) for option in by_range(self.batch, self.plant)], base)
        yield from self._timings(bad, base)
        yield from self._gains(bad, base)
        yield from self._both(bad, base)

    def _promising(self, fault: Fault, bad: Sequence[int], base: np.ndarray) -> tuple[float, list[int]] | None:
        cost = self._screen(fault)
        if cost is None:
            return None
        better = [k for k in bad if cost[k] < PROMISING * base[k] and k in fault.joints]
        return (float((base - cost)[better].sum()), better) if better else None

    def _timings(self, bad: Sequence[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        everyone = range(len(base))
        rows = min(len(episode) for episode in self.batch.episodes)
        for fault in timings(everyone, rows):
            promising = self._promising(fault, bad, base)
            if promising is None:
                continue
            if fault.kind == "rate" or len(promising[1]) >= ALL * len(bad):
                yield promising[0], fault
            else:
                alone = next(timing for timing in timings(promising[1], rows) if timing.value == fault.value)
                yield promising[0], alone

    def _gains(self, bad: Sequence[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        """Yield the best gains of all joints together, and of each one, if they are far from what they are."""
        everyone = range(len(base))
        grid = [(fault, cost) for fault in gain_grid(everyone, self.plant) if (cost := self._screen(fault)) is not None]
        costs = np.array([cost for _, cost in grid])[:, list(bad)]
        drops = (base[list(bad)] - costs).sum(axis=1)
        if drops.max() > 0.0:
            yield float(drops.max()), grid[int(drops.argmax())][0]
        best = {k: int(costs[:, place].argmin()) for place, k in enumerate(bad)}
        better = [k for place, k in enumerate(bad) if costs[best[k], place] < PROMISING * base[k]]
        if better:
            kp, kd = ([float(grid[best[k]][0].value[name][k]) for k in better] for name in ("kp", "kd"))
            drop = sum(float(base[k] - grid[best[k]][1][k]) for k in better)
            yield drop, gains(kp, kd, better)

    def _both(self, bad: Sequence[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        """Yield axes that point the other way, and joints that have each other's names, in commands and positions."""
        minus, nothing = np.full(len(base), -1.0), np.zeros(len(base))
        turned = {k: self._screen(rescale("sign", [k], BOTH, minus, nothing, {})) for k in bad}
        better = [k for k, cost in turned.items() if cost is not None and cost[k] < PROMISING * base[k]]
        if better:
            drop = sum(float(base[k] - cost[k]) for k in better if (cost := turned[k]) is not None)
            yield drop, rescale("sign", better, BOTH, minus, nothing, {})
        if len(bad) > 1:
            yield from self._propose_exchange(list(bad), base)

    def _propose_exchange(self, bad: list[int], base: np.ndarray) -> Iterator[tuple[float, Fault]]:
        """Yield the exchange of joints in question that fits best, from how well each joint replays each channel."""
        matrix = np.diag(base[bad] * PROMISING)
        for turn in range(1, len(bad)):
            order = np.arange(len(base))
            order[bad] = np.roll(bad, -turn)
            cost = self._screen(permute(order.tolist(), BOTH))
            for place, joint in enumerate(bad):
                matrix[place, (place + turn) % len(bad)] = np.inf if cost is None else cost[joint]
        _, chosen = linear_sum_assignment(np.where(np.isfinite(matrix), matrix, 1e6))
        if (chosen == np.arange(len(bad))).all():
            return
        order = np.arange(len(base))
        order[bad] = np.array(bad)[chosen]
        fault = permute(order.tolist(), BOTH)
        if (cost := self._screen(fault)) is not None and (drop := float((base - cost).sum())) > 0.0:
            yield drop, fault


def _best(standing: Sequence[tuple[Fault, Fit]], before: Fit) -> Stand:
    """Return the fault that leaves least, with those of other kinds or sides that leave hardly more."""
    best, after = min(standing, key=lambda pair: float(pair[1].cost.sum()))
    rivals = tuple(
        fault
        for fault, other in standing
        if (fault.kind, fault.side) != (best.kind, best.side) and other.cost.sum() < EVEN * after.cost.sum()
    )
    return Stand(best, before, after, rivals)


def _stands(fault: Fault, before: Fit, after: Fit) -> bool:
    """Whether a fault leaves so much less of its joints than physics alone that physics is out of the question."""
    own = list(fault.joints)
    left = float(np.sqrt((after.rms[own] ** 2).mean()) / np.sqrt((before.rms[own] ** 2).mean()))
    excess = float((before.cost[own] - NOISE_COST).sum())
    gone = float((before.cost[own] - after.cost[own]).sum()) / excess if excess > 0.0 else 0.0
    return left <= HALF and gone >= SHARE
