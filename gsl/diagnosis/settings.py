"""The numbers that decide something in a diagnosis, frozen, each with its reason or source.

Costs are robust costs of residuals in noise floors: one that holds nothing but noise costs 0.96 (`noise_cost`).
"Measured" means: on logs whose cause is known. "Estimate" means: nobody has measured it yet, here is where to begin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class FloorSettings:
    """How the noise floor is measured, and which joints count as shaking."""

    settled: int = 15  # ticks after which the start of an episode is forgotten: 0.3 s at 50 Hz
    estimate: int = 200  # samples that an estimate from roughness is worth: other motion than noise is in it
    unsteady: float = 4.0  # spread of a joint's repeats, in medians of the joints, that is no noise any more
    quiet: float = 0.3  # share of the ticks, those of the slowest motion, on which roughness is measured
    coloured: float = 0.4  # correlation of a resting joint's log with itself some ticks later: noise has none
    lags: int = 4  # ticks over which that correlation is looked for
    usual: float = 0.75  # share of the resting windows, the calmest, that is looked at: a push is no shaking
    rests: int = 2  # resting windows that it takes to judge
    own: float = 0.45  # share of its motion that is a joint's own. Measured: to 0.39 if carried along, 0.58 shaking
    ways: int = 2  # in which the other joints move together that are looked at
    still: float = 1e-6  # a command that moves less rests [rad]: rounding in a file
    spectrum: int = 64  # ticks of the windows whose spectrum shows white noise
    skipped: int = 3  # lowest frequencies of it, where the motion is
    quietest: float = 0.2  # share of the windows and frequencies that noise alone fills
    smooth: float = 0.25  # share of white noise's power below which a command's own roughness does not count
    unwhite: float = 1.5  # times white noise that is none. Measured: up to 1.1 on calm joints, up to 9 on shaking ones
    tick: float = 0.02  # [s], of `settled` and of the next two lines where slow shaking is looked for in a faster log
    wavering: int = 24  # ticks of smooth commands over which a joint that shakes slowly swings: 0.5 s
    late: tuple[int, ...] = (0, 2, 4)  # ticks by which a joint follows its command
    least: int = 3  # such windows that it takes to judge
    windows: int = 200  # of these that are looked at, spread over the log
    unsteadily: float = (
        1.5  # times white noise. Measured: up to 1.1 on calm joints, 3.4 with cogging, 12 on shaking ones
    )
    unmeasured: float = 3.0  # encoder steps that are the floor where every joint shakes


@dataclass(frozen=True)
class RepeatSettings:
    """When two records are of the same motion: their commands, as functions of time, are the same."""

    same: float = 2e-3  # difference of commands that is rounding [rad]: a step of 4,096 in a turn is 1.5e-3
    clear: float = 5.0  # times that, by which a joint has to move to say when a motion began
    of_range: float = 0.02  # share of a joint's range by which that of a repeat may differ: its peaks fall between rows
    jitter: float = 0.01  # by which a row's time may be off [s], at least a row
    outside: float = 0.02  # share of the rows in which commands may differ by more than a row's time makes them
    apart: float = 2.0  # by which loggers may have begun at different times [s]
    share: float = 0.8  # of the longer record that both have to have


@dataclass(frozen=True)
class LogSettings:
    """How a log is cut into windows and parted for fitting and checking."""

    warm_up: float = 0.4  # of a window, not scored [s]: shorter ones bias friction, whose state a log does not show
    scored: float = 0.6  # of a window [s]
    walk_warm_up: float = 0.1  # the same of a walk [s], where replays part soon
    walk_scored: float = 0.2
    walk_windows: int = 200  # of walks, spread over all: a replay in Bullet takes milliseconds
    fit_windows: int = 32  # that a fit uses, spread over the training records
    check_windows: int = 400  # that a check uses, spread over the others
    block: int = 2  # windows side by side that are held out together, where motions have no names: 1.2 s
    base_floor: tuple[float, ...] = (1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3)  # of x, y, z [m], roll, pitch, yaw. Estimate
    floor: FloorSettings = field(default_factory=FloorSettings)
    repeats: RepeatSettings = field(default_factory=RepeatSettings)


@dataclass(frozen=True)
class GridSettings:
    """Where a screening tries an effect, as shares of the way from doing nothing to the end of its documented range."""

    one_sided: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)  # closer together near nothing
    dense: tuple[float, ...] = (
        0.02,
        0.05,
        0.1,
        0.15,
        0.22,
        0.3,
        0.4,
        0.5,
        0.65,
        0.8,
        1.0,
    )  # where joints shake: minima are narrow
    two_sided: tuple[float, ...] = (0.05, 0.15, 0.35, 0.65, 1.0)  # on either side
    paired: tuple[float, ...] = (0.2, 0.6)  # where two strengths are searched together
    shapes: tuple[float, ...] = (0.0, 0.3, 1.0)  # of the range of a velocity or another parameter that is no strength
    beyond: float = 1.5  # how far past its range a strength is fitted; there it loses its claim to the name


@dataclass(frozen=True)
class FitSettings:
    """How a hypothesis is fitted."""

    rounds: int = 4  # steps of a descent, at most
    every: int = 2  # steps for which sensitivities to the calibration, which change little, are kept
    dampings: tuple[float, ...] = (0.0, 1.0, 30.0)  # shares of the diagonal: friction's derivatives hold nearby only
    well: float = 0.05  # relative descent of a step beside which others are not tried
    enough: float = 1e-3  # relative descent at which a fit ends
    factors: tuple[float, ...] = (1.2, 1.08)  # of a parameter, in a search without derivatives
    poor: float = 1.5  # cost of a residual that makes such a search worth its time
    probe: float = 0.02  # share of a parameter's range by which a derivative is probed
    share: float = 0.2  # and of a positive parameter's value, at most
    parts: float = 2.0  # change of a parameter's logarithm in one step, at most: a factor of 7


@dataclass(frozen=True)
class SearchSettings:
    """Which hypotheses are tried, and what one has to gain to stand."""

    noise_cost: float = 0.96  # of a residual that is nothing but noise: 0.947 if exactly normal. Estimate
    gain: float = 20.0  # least gain of an effect: log-odds of 10, against some hundred candidates and scopes. Estimate
    freed: float = 60.0  # of the cost of shifts, that is enough whatever chance gains: a shift of 8 spreads. Estimate
    chance: float = 1.3  # how far above the best gain of chance, of a few simulated nulls, an effect has to be
    walk_share: float = (
        0.1  # share of the cost that chance gains on the ground, where no log is simulated. Measured on walks
    )
    shaking_share: float = 0.1  # the same of joints that shake: their phase is chance. Estimate
    least_share: float = 0.2  # of what is left, that a further effect has to explain. Estimate
    minor: float = 0.005  # of what is explained already: less is no cause but a flaw of the model
    flaw: float = 0.005  # of the calibration's cost, that a simulator's own flaws (its time step) let any effect gain
    room: float = 1.0  # cost of a residual that leaves room for a second effect
    room_after: float = 1.1  # and for a third and later ones: these have to be more than small
    room_of_one: float = 1.2  # the same of a single joint, whose held-out windows are few
    hidden: float = 0.5  # share of what a cause has to gain, that it frees of the cost of shifts: residuals give more
    leads: int = 10  # that are fitted after the first screening
    leads_after: int = 5  # that are fitted beside an effect that stands already
    again: int = 3  # one in so many of these may be of an effect that has a better one
    hardly: float = 0.1  # share of what a screening saw of an effect, from which a fit beside others begins as well
    beam: int = 2  # single effects that are continued
    few: int = 20  # training windows of which a screening leaves none out
    walk_windows: int = 8  # of a walk that a screening looks at
    invisible: float = 0.25  # rms [floors] below which the strongest setting of an effect leaves no trace
    dominant: float = 0.25  # share of the excess that makes a joint a suspect, in which every effect is tried alone
    suspects: int = 2  # such joints, at most
    near: float = 0.2  # share of what is explained within which rivals are polished, where joints shake
    challengers: int = 2  # how many of them
    values: int = 11  # of an effect beside which others are screened, at most
    too_far: float = 3.0  # times what calibration alone costs, beyond which nothing makes a value good. Estimate
    apart: float = 1.5  # spreads by which the mean calibration of a group is off that is a cause's
    many: int = 4  # joints whose mean zero is looked at
    like: float = 5.0  # joints that the usual spread of zeros counts for, beside those of the robot itself. Estimate
    aside: float = 3.5  # standard errors by which it is off that are no chance. Measured: 2.8 without such a cause
    restarts: int = 40  # windows that measure what a log of a walk does not show
    same_robot: float = 0.3  # of the usual spread: how far a calibration may change from a reference to the log
    clock_starts: tuple[float, ...] = (0.002, 0.02, 0.05)  # where a fit of two clocks' shift starts [s]
    fit: FitSettings = field(default_factory=FitSettings)
    grids: GridSettings = field(default_factory=GridSettings)


@dataclass(frozen=True)
class PlausibilitySettings:
    """What a logged channel has to show of a cause."""

    spread: tuple[float, float] = (2.0, 98.0)  # percentiles between which a channel moves
    sag: float = 0.2  # predicted fall of the voltage from which on a log has to show it [V]
    sag_share: float = 0.5  # and the least part of it that it must show
    warmth: float = 1.0  # by which a motor warms up in an episode before its gain can fade for it [°C]
    worse: float = 1.3  # factor on the error of a predicted torque, with a cause over without it, that refutes it


@dataclass(frozen=True)
class LawSettings:
    """How a law for each servo is learned on top of a hypothesis, and what it has to explain to speak against that.

    What is of material size lies between what laws explain on top of true causes (0.013 of all joints, 0.04 of one) and
    on top of the nearest effects where a target smoothing is missing (0.15 of all joints, 0.4 of one).
    """

    windows: int = 400  # of either part of a log, spread over it
    lags: int = 5  # control periods back
    plays: tuple[float, ...] = (0.004, 0.016)  # full widths of plays [rad]: below and above those of usual gears
    ridges: tuple[float, ...] = (1e-4, 1e-3, 1e-2, 0.1, 1.0)  # shares of the residuals
    folds: int = 4  # of the training windows, by which a ridge is chosen
    reweightings: int = 3  # of a fit whose residuals count less the larger they are
    of_all: float = 0.03  # cost of a residual of all joints, where noise costs 0.96, that is of material size. Measured
    of_joint: float = 0.15  # the same of one joint. Measured
    samples: int = 1000  # of the bootstrap
    listed: int = 3  # joints whose form is shown,
    least_share: float = 0.3  # if they gain as large a share of the largest gain
    points: int = 12  # of a curve


@dataclass(frozen=True)
class VerdictSettings:
    """What the evidence allows to say."""

    survivors: int = 3  # hypotheses that duel, at most
    behind: float = 200.0  # cost by which one may be behind to duel
    behind_share: float = 0.1  # or share of what is explained
    settle: int = 25  # ticks for which the first command is held before a simulated record begins
    start: float = 0.02  # spread of the joints before that [rad]
    separated: float = 0.75  # probability below which two causes are not told apart: odds of 3
    blunt: float = 12.0  # least spread of a difference of costs, where no self-test has measured it
    coarse: float = 0.12  # share of a difference of costs that an imperfect model makes. Estimate
    walk_doubt: float = 0.05  # share of the cost by which two causes differ by chance on the ground. Estimate
    shaking_doubt: float = 0.08  # the same of joints that shake. Estimate
    foreign: float = 1.12  # remaining cost, and
    explained: float = 0.85  # share explained, beyond which nothing of the library is the cause
    local: float = 1.5  # remaining cost of one joint that is as strange
    odd: float = 7.0  # times the most that two own logs leave of a shaking joint. Measured: to 4.2 if true, 14 if not
    loud: float = 2.0  # cost of a joint's residual below which it is not odd: one that hardly shakes may, or may not
    soft: float = 0.15  # how gradually strangeness turns into `unknown`
    unrivalled: float = 0.9  # probability of an effect in whose place no other was tried: where replays are slow
    lone: float = 0.8  # factor on probabilities where parts of one motion are held out: they share what is its own
    whole: float = 0.9  # share of the excess from which on causes are all there is
    sure: float = 0.9  # probability of every cause from which on they are the causes
    even: float = 0.5  # and probable ones
    wider: float = 2.0  # than white noise makes intervals: residuals of a joint hang together in time. Estimate
    off: float = 4.5  # spreads from which on a calibration is out of family: nearly what a rotor may be too light by
    far: float = 2.0  # floors above which a part of the log may be unexplained,
    as_before: float = 0.95  # if it is more than this share of what it was before,
    farthest: float = 5.0  # or above as many floors
    no_excess: float = 0.02  # in squared floors: below it there is nothing to shrink
    limit: float = 0.5  # share of a documented range above which a limit says nothing
    hardly: float = 0.002  # share that is hardly any of an effect: play of no width has teeth that give all the same
    halvings: int = 4  # of a limit: to a factor of 1.4
    limit_rounds: int = 3  # of its fits
    asked: float = 0.05  # command [rad],
    stuck: float = 0.1  # and share of it, below which a joint that moves less does not move
    beneath: float = 0.7  # such a cost of all and of each joint leaves nothing to explain: noise makes 0.9 at least
    rough: float = 20.0  # remaining cost of a residual, in that of noise, from which on a tolerance is advised
    left: float = 0.1  # share of the held-out excess that is left, from which on something else is at work
    law: LawSettings = field(default_factory=LawSettings)

    def widening(self, remaining: float) -> float:
        """Return how much wider an interval is than noise alone makes it: what is left unexplained widens it.

        Args:
            remaining: Cost of a residual over that of noise.
        """
        return self.wider * math.sqrt(max(1.0, remaining))


@dataclass(frozen=True)
class LocaliseSettings:
    """Where residuals are looked at apart."""

    rest: float = 0.01  # share of the no-load speed: slower is rest
    fast: float = 0.12  # and faster is fast
    reversal: float = 0.06  # before and after a change of direction [s]
    loaded: float = 0.4  # share of the torque limit that the nominal servo would want
    saturated: float = 1.0
    contact: float = 0.08  # after a foot has touched the ground [s]
    samples: int = 400  # of the bootstrap
    flips: int = 5000  # of signs, in a test of two sides: of one pair in many a chance of 0.001 has to be seen
    above: float = 1.1  # floors: a lower bound has to be above it, for of many cells some are high by chance
    least: int = 3  # samples that have to show a cell, and windows a pair of joints
    alike: float = 0.1  # share of the larger reach by which those of two commands may differ


@dataclass(frozen=True)
class DesignSettings:
    """When a question is worth asking, and how a next experiment is chosen."""

    strength: float = 0.5  # share of the way to the end of its range at which an effect should be seen
    visible: float = 30.0  # log-odds from which a log shows an effect of that strength: two a joint of a NAO
    dry: tuple[float, ...] = (0.0, 0.03, 0.1, 0.22, 0.45)  # Coulomb friction tried in load friction's place [N·m]
    loose: float = 10.0  # how much freer the calibration is beside it: under one load the two are one
    enough: float = 30.0  # log-odds with which a question is answered: what comes on top decides only between equals
    worth: float = 3.0  # log-odds below which a motion is not worth playing
    certain: float = 100.0  # log-odds beyond which their size says nothing any more
    listed: int = 4  # effects that a sentence names
    threads: int = 2  # of a rehearsal: more would hold more logs at once for little
    wrong: float = 1.0  # share of a load beyond which it is no longer taken for wrong instead of a zero
    zero: float = 1.5  # spreads of the zeros of one make beyond which a zero is worth a thought
    told_apart: float = 30.0  # squared distance, in noise, from which on a log tells a zero from a load
    windows: int = 60  # whose gravity is looked at
    positions: int = 21  # of a joint between which the farthest two are chosen
    own: float = 1.2  # times as much another joint has to do to be moved in a joint's place
    rungs: int = 5  # of each joint on a ladder of poses
    hold: float = 0.8  # of a rung [s]
    way: float = 0.8  # least time from one rung to the next [s]
    plays: int = 3  # of a rung: two variants and a repeat
