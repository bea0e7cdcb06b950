"""Published models of a servo against each other: open-loop replays of real motions that no fit has seen."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.body import lump
from gsl.core.console import Console
from gsl.core.setting import component, setting
from gsl.core.statistics import bootstrap_interval
from gsl.diagnosis.log.files import check_log, log_parents, read_logs
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces, to_records
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects, InTheAir
from gsl.errors import ConfigError
from gsl.report.markdown import table as markdown
from gsl.report.run_page import Answer
from gsl.report.study_page import write_study_page
from gsl.rollout.parallel import Workers, threads
from gsl.storage.documents import write_json
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Windows

TABLE, DATA = "table.md", "errors.json"
DIAGNOSED = "diagnosed"
WAYS = ("as published", "one gain", "one gain, zeros")
FAR = 7.0  # powers of 2 of the free gain: Menagerie's kp is 85 times ours
FINEST = 0.25  # power of 2 to which it is fitted


@component
class Bench:
    """A log and the worlds that replay it."""

    real: Annotated[str, setting("trajectories in the air: a run, a parquet file or a folder of them", min_length=1)]
    worlds: Annotated[Mapping[str, BulletWorld], setting("the servo models, by name", min_length=1)]
    by: Annotated[str, setting("label whose values are held out", min_length=1)]
    diagnoses: Annotated[str, setting("folds.json of gsl cross-validate, whose held-out values are taken")]
    nominal: Annotated[str, setting("which of the worlds these diagnoses change")]


@dataclass(frozen=True)
class Errors:
    """Of one model on one bench.

    Attributes:
        model: Its name.
        way: What was fitted on the other motions.
        gains: The free factor on kp, by fold.
        mean: Absolute error of every trajectory and joint [rad], shape (n, n_joints).
        square: Mean square error of them [rad²].
    """

    model: str
    way: str
    gains: tuple[float, ...]
    mean: np.ndarray
    square: np.ndarray


@component
class Servos:
    """Every model is judged as it is published, after one factor on all kp, and with the joints' zeros as well.

    Factor and zeros are fitted to the trajectories that are not held out. A model `diagnosed` is the nominal one with
    what a diagnosis of these trajectories found, without its calibration of single joints.
    """

    kind: ClassVar[str] = "reproduce"

    benches: Annotated[Mapping[str, Bench], setting("logs and models, by the robot's name", min_length=1)]
    workers: Workers = -1

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        logs = {
            name: path for key, bench in self.benches.items() for name, path in log_parents(**{key: bench.real}).items()
        }
        return logs | {f"{key}.diagnoses": Path(bench.diagnoses) for key, bench in self.benches.items()}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Replay all, write every error and the tables."""
        texts, best = list[str](), dict[str, str]()
        document: dict[str, Any] = {}
        for name, bench in self.benches.items():
            trial = Trial.of(bench, threads(self.workers))
            rows = [row for model in trial.models for row in trial.judge(model, console)]
            motions = [record.name for record in trial.records]
            texts.append(f"## {name}\n\n{tell(rows, motions, trial.joints)}\n{trial.remark}\n")
            document[name] = [
                {"model": row.model, "fitted": row.way, "gains": row.gains, "mean": row.mean, "square": row.square}
                for row in rows
            ]
            document[f"{name} trajectories"] = motions
            own = [row for row in rows if row.way == WAYS[0] and np.isfinite(row.mean).all()]
            best[name] = min(own, key=lambda row: float(row.mean.mean())).model
        write_json(folder / DATA, json.loads(json.dumps(document, default=np.ndarray.tolist)))
        (folder / TABLE).write_text("\n".join(texts), encoding="utf-8")
        winners = "; ".join(f"{name}: {model}" for name, model in best.items())
        answer = Answer("Which published servo model replays real motions best, as it is?", winners, False, [])
        write_study_page(folder, answer, [TABLE], [])
        return {"best": best}


@dataclass(frozen=True)
class Trial:
    """A bench at work: records, the folds they are held out in, and every model by name.

    Attributes:
        records: Trajectories that are replayed whole.
        fold: In which each of them is held out, shape (n,).
        models: World and effects by fold, by name.
        joints: Names of the logged joints.
        period: Control period [s].
        remark: A sentence on the fold's file.
        threads: That replay side by side.
    """

    records: Sequence[Record]
    fold: np.ndarray
    models: Mapping[str, tuple[BulletWorld, Sequence[Effects]]]
    joints: Sequence[str]
    period: float
    remark: str
    threads: int

    @classmethod
    def of(cls, bench: Bench, count: int) -> Trial:
        """Read a bench's log and diagnoses.

        Raises:
            ConfigError: The nominal world is not there, or a trajectory is in no fold.
        """
        if bench.nominal not in bench.worlds:
            raise ConfigError("nominal", f"is none of the worlds {', '.join(bench.worlds)}", given=bench.nominal)
        log, robot = read_logs(bench.real), lump(bench.worlds[bench.nominal].plant.robot)
        check_log(log, robot, bench.real)
        records = [record.cut_to_driven() for record in to_records(log, robot)]
        records = [record for record in records if len(record)]
        folds = json.loads(Path(bench.diagnoses).read_text(encoding="utf-8"))
        places = {str(value): k for k, fold in enumerate(folds) for value in fold["values"]}
        labels = [str(record.about.get(bench.by)) for record in records]
        if lost := [label for label in labels if label not in places]:
            raise ConfigError("diagnoses", f"holds no fold without {bench.by} {lost[0]}", given=bench.diagnoses)
        bare: Sequence[Effects] = [{}] * len(folds)
        models = {name: (world, bare) for name, world in bench.worlds.items()}
        models[DIAGNOSED] = bench.worlds[bench.nominal], [fold["parameters"] for fold in folds]
        with_all = 1e3 * float(np.mean(np.concatenate([fold["errors"]["diagnosed"] for fold in folds])))
        remark = f"With its calibration of single joints the diagnosis leaves {with_all:.1f} mrad in the same folds."
        fold = np.array([places[label] for label in labels])
        return cls(records, fold, models, robot.controlled, log.control_period, remark, count)

    def judge(self, name: str, console: Console) -> list[Errors]:
        """Return the errors of a model on held-out trajectories, in each of WAYS."""
        n, (world, effects) = len(self.joints), self.models[name]
        simulator = InTheAir(
            world.plant, fitting_step(world.step, self.period), self.period, self.threads, accurate=True
        )
        every, firsts = np.arange(len(self.records)), self._firsts()
        mean, square = (np.full((len(WAYS), len(self.records), n), np.nan) for _ in range(2))
        played: dict[str, dict[float, list[np.ndarray]]] = {}
        gains: list[float] = []
        for k, some in enumerate(effects):
            held, cache = every[self.fold == k], played.setdefault(json.dumps(some, sort_keys=True), {})
            rest = [place for place, index in enumerate(firsts) if self.fold[index] != k]

            def errors(gain: float, some: Effects = some, cache: dict[float, list[np.ndarray]] = cache) -> Any:
                if gain not in cache:
                    cache[gain] = self._replay(simulator, some, gain, firsts)
                return cache[gain]

            def loss(gain: float, rest: Sequence[int] = rest, errors: Callable[[float], Any] = errors) -> float:
                return _loss([errors(gain)[place] for place in rest])

            best = climb(loss)
            zero = np.median(np.concatenate([errors(best)[place] for place in rest]), axis=0)
            plain, own = (self._replay(simulator, some, gain, held) for gain in (0.0, best))
            for way, parts in enumerate((plain, own, [error - zero for error in own])):
                mean[way, held] = [np.abs(error).mean(axis=0) for error in parts]
                square[way, held] = [(error**2).mean(axis=0) for error in parts]
            gains.append(float(2.0**best))
        console.status(f"{name}: {1e3 * float(mean[0].mean()):.1f} mrad, gain {min(gains):.2g} to {max(gains):.2g}")
        factors = [(1.0,) * len(gains), tuple(gains), tuple(gains)]
        return [Errors(name, way, factors[k], mean[k], square[k]) for k, way in enumerate(WAYS)]

    def _firsts(self) -> np.ndarray:
        """Return one trajectory of each motion, on which gain and zeros are fitted: repeats say the same of them."""
        labels = [(record.name, json.dumps(record.conditions, sort_keys=True)) for record in self.records]
        return np.array([k for k, label in enumerate(labels) if label not in labels[:k]])

    def _replay(self, simulator: InTheAir, effects: Effects, gain: float, index: np.ndarray) -> list[np.ndarray]:
        """Return the errors of whole replays [rad], (T, n_joints) each, with kp times 2 to the power of `gain`."""
        pieces = pad([self.records[k] for k in index], simulator, self.period)
        factor = [{"kp": float(2.0**gain), "kd": 1.0, "joints": "all"}]
        replayed = simulator.simulate({**effects, "servo_gain": factor}, no_shifts(len(self.joints)), pieces)
        lengths = [len(self.records[k]) for k in index]
        return [replayed[k, :length] - pieces.real[k, :length] for k, length in enumerate(lengths)]


def climb(loss: Callable[[float], float]) -> float:
    """Return the power of 2 at which a loss of one valley is least, to FINEST, from 0 on and no farther than FAR."""
    best, step = 0.0, 1.0
    while step >= FINEST:
        near = [exponent for exponent in (best - step, best + step) if abs(exponent) <= FAR]
        lower = min(near, key=loss)
        if loss(lower) < loss(best):
            best = lower
        else:
            step *= 0.5
    return best


def pad(records: Sequence[Record], simulator: InTheAir, period: float) -> Pieces:
    """Return whole records as windows of one length, to be replayed side by side; the last command stays."""
    robot, longest = lump(simulator.plant.robot), max(map(len, records))
    whole = [cut_pieces([record], robot, period, warm_up=0, scored=len(record)) for record in records]
    commands, real = [], []
    for piece, record in zip(whole, records, strict=True):
        extra = longest - len(record)
        newest_first = piece.windows.commands[0]
        commands.append(np.concatenate([np.repeat(newest_first[:1], extra, axis=0), newest_first]))
        real.append(np.concatenate([piece.real[0], np.full((extra, piece.real.shape[2]), np.nan)]))
    motion, clock = np.concatenate([piece.windows.motion for piece in whole]), np.zeros(len(whole))
    conditions = tuple(record.conditions for record in records) if any(record.conditions for record in records) else ()
    numbers = np.arange(len(whole))
    return Pieces(Windows(np.array(commands), motion, clock), np.array(real), numbers, 0 * numbers, 0, conditions)


def _loss(errors: Sequence[np.ndarray]) -> float:
    """Return the mean absolute error of replays [rad], large where one diverges."""
    value = float(np.mean([np.abs(error).mean() for error in errors]))
    return value if np.isfinite(value) else 1e3


def tell(rows: Sequence[Errors], motions: Sequence[str], joints: Sequence[str]) -> str:
    """Return the tables: all joints with intervals over motions, then every joint."""
    titles = ("model", "fitted on other motions", "factor on kp", "mean absolute [mrad]", "rms [mrad]")
    whole = [(row.model, row.way, _factor(row), _mean(row, motions), _rms(row, motions)) for row in rows]
    single = ("model", "fitted on other motions", *joints)
    each = [
        (row.model, row.way, *(f"{_mean(row, motions, k)}; {_rms(row, motions, k)}" for k in range(len(joints))))
        for row in rows
        if len(joints) > 1
    ]
    below = "Intervals of 95 % by bootstrap over motions, repeats together.\n"
    if not each:
        return f"{markdown(titles, whole)}\n{below}"
    return f"{markdown(titles, whole)}\n{below}\nBy joint, mean absolute; rms [mrad]:\n\n{markdown(single, each)}"


def _factor(errors: Errors) -> str:
    low, high = min(errors.gains), max(errors.gains)
    return "1" if errors.way == WAYS[0] else f"{low:.2g} to {high:.2g}"


def _mean(errors: Errors, motions: Sequence[str], joint: int | None = None) -> str:
    return _interval(errors.mean, motions, joint, lambda values: 1e3 * float(values.mean()))


def _rms(errors: Errors, motions: Sequence[str], joint: int | None = None) -> str:
    return _interval(errors.square, motions, joint, lambda values: 1e3 * float(np.sqrt(values.mean())))


def _interval(values: np.ndarray, motions: Sequence[str], joint: int | None, statistic: Any) -> str:
    """Return a statistic of trajectories, shape (n, n_joints), with its interval over motions drawn again."""
    chosen = values if joint is None else values[:, [joint]]
    if not np.isfinite(chosen).all():
        return "diverges"
    groups = [np.flatnonzero([name == motion for name in motions]) for motion in dict.fromkeys(motions)]

    def resample(index: np.ndarray) -> float:
        return float(statistic(chosen[np.concatenate([groups[k] for k in index])]))

    interval = bootstrap_interval(resample, len(groups), np.random.default_rng(0))
    return f"{interval.mean:.1f} ({interval.lower:.1f} to {interval.upper:.1f})"
