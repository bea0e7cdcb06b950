"""Servo models of Rhoban/bam fitted by bam's own rules to logs of its bench, one gain held out after another.

Its rules: rows every 5 ms, interpolated linearly; one explicit step a row; friction as a torque that stops at most;
the mean absolute error of open-loop positions; CMA-ES with restarts in boxes (fit.py, simulate.py, model.py,
testbench.py, process.py and xl330/actuator.py of Rhoban/bam, Apache-2.0, read in 2026-11; Duclusaud and Passault).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.seeds import derive_seed
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.report.markdown import table as markdown
from gsl.report.run_page import Answer
from gsl.report.study_page import write_study_page
from gsl.rollout.parallel import Workers, in_parallel
from gsl.storage.documents import write_json
from gsl_experiments.bam_bench import Logs, read_bench, score, to_law

TABLE, DATA = "table.md", "fits.json"
SIGMA = 1.0 / 6.0  # of a box's width, with which its search begins
RESTARTS = 100  # at most: evaluations end a search
SETTLED = 1e-6  # change of the error at which a search ends and another one begins [rad]; finer ones cost restarts

BOXES: Mapping[str, tuple[float, float]] = {
    "kt": (0.3, 3.0),
    "R": (0.5, 5.0),
    "armature": (1e-4, 0.05),
    "q_offset": (-0.1, 0.1),
    "command_delay": (0.0, 0.05),
    "friction_base": (0.0, 0.2),
    "friction_viscous": (0.0, 1.0),
    "load_friction_base": (0.0, 0.5),
    "load_friction_motor": (0.0, 0.5),
    "load_friction_external": (0.0, 0.5),
    "friction_stribeck": (0.0, 0.2),
    "dtheta_stribeck": (0.1, 1.0),
    "alpha": (1.0, 10.0),
    "load_friction_stribeck": (0.0, 1.0),
    "load_friction_motor_stribeck": (0.0, 1.0),
    "load_friction_external_stribeck": (0.0, 1.0),
    "load_friction_motor_quad": (0.0, 0.01),
    "load_friction_external_quad": (0.0, 0.01),
}
"""Bounds of bam's parameters, by its names."""

_ALWAYS = ("kt", "R", "armature", "q_offset", "command_delay", "friction_base", "friction_viscous")
_STRIBECK = ("friction_stribeck", "dtheta_stribeck", "alpha")
_M6 = (
    "load_friction_motor", "load_friction_external", "load_friction_motor_stribeck", "load_friction_external_stribeck",
    "load_friction_motor_quad", "load_friction_external_quad",
)  # fmt: skip
MODELS: Mapping[str, tuple[str, ...]] = {
    "m1": _ALWAYS,
    "m3": (*_ALWAYS, "load_friction_base"),
    "m4": (*_ALWAYS, "load_friction_base", *_STRIBECK, "load_friction_stribeck"),
    "m6": (*_ALWAYS, *_STRIBECK, *_M6),
}
"""The parameters of each model: Coulomb and viscous, by load, Stribeck, by direction and squared."""


@dataclass(frozen=True)
class Fit:
    """A model that was fitted without the logs of one gain."""

    model: str
    held_out: float
    parameters: Mapping[str, float]
    fitted: float
    checked: float


@component
class Bam:
    """Fits each model to the logs of all gains but one, and replays those of this one."""

    kind: ClassVar[str] = "reproduce"

    logs: Annotated[str, setting("folder of bam's raw logs, .json.gz", min_length=1)]
    models: Annotated[tuple[str, ...], setting("of M1, M3, M4 and M6: m1, ...", min_length=1)] = tuple(MODELS)
    evaluations: Annotated[int, setting("replays of all logs in each of a fit's two searches", ge=10)] = 14_000
    seed: Annotated[int, setting("of all randomness", ge=0)] = 1
    workers: Workers = -1

    def __post_init__(self) -> None:
        """Refuse a model that is none."""
        for name in self.models:
            if name not in MODELS:
                raise ConfigError("models", f"is none of {', '.join(MODELS)}", given=name)

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        return {path.name: path for path in list_logs(self.logs)}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Fit all, write every fit and the table."""
        logs = read_bench(list_logs(self.logs))
        gains = [float(gain) for gain in np.unique(logs.kp)]
        jobs = [(model, gain, derive_seed(self.seed, model, f"{gain:g}")) for model in self.models for gain in gains]
        with console.progress(len(jobs), "fitting models") as progress:
            fits = in_parallel(fit_job, (logs, self.evaluations), jobs, self.workers, progress)
        write_json(folder / DATA, [vars(fit) | {"parameters": dict(fit.parameters)} for fit in fits])
        (folder / TABLE).write_text(tell(fits), encoding="utf-8")
        means = {name: float(np.mean([fit.checked for fit in fits if fit.model == name])) for name in self.models}
        best = min(means, key=lambda name: means[name])
        said = f"{best.upper()}, {1e3 * means[best]:.1f} mrad"
        answer = Answer("Which of bam's models predicts a gain that it has not seen?", said, False, [])
        write_study_page(folder, answer, [TABLE], [])
        return {"mean_error": means, "evaluations": self.evaluations}


def list_logs(folder: str) -> list[Path]:
    """Return the logs of a folder.

    Raises:
        ConfigError: There are none.
    """
    if paths := sorted(Path(folder).glob("*.json.gz")):
        return paths
    raise ConfigError("logs", "holds no file *.json.gz; name a folder of raw logs", given=folder)


def fit(model: str, logs: Logs, evaluations: int, seed: int) -> tuple[Mapping[str, float], float]:
    """Return the parameters of a model that replay logs best, by bam's names, and their error [rad].

    Two searches: all from the middle of the boxes, or each from another place. Either alone got stuck in some folds.
    """
    import cma

    names = MODELS[model]
    low, high = np.array([BOXES[name] for name in names]).T

    def unfold(x: np.ndarray) -> dict[str, float]:
        return dict(zip(names, (low + np.clip(x, 0.0, 1.0) * (high - low)).tolist(), strict=True))

    options: dict[str, Any] = {
        "bounds": [0.0, 1.0],
        "maxfevals": evaluations,
        "seed": seed,
        "verbose": -9,
        "verb_log": 0,
    }
    rng, middle = np.random.default_rng(seed), np.full(len(names), 0.5)
    quick = {"tolfun": SETTLED, "tolfunhist": SETTLED}
    starts: list[tuple[Any, dict[str, float]]] = [(middle, {}), (lambda: rng.random(len(names)), quick)]
    ends: list[tuple[float, dict[str, float]]] = []
    for start, more in starts:
        best, _ = cma.fmin2(
            lambda x: score(to_law(unfold(x)), logs), start, SIGMA, options | more, bipop=True, restarts=RESTARTS
        )
        values = unfold(np.asarray(best))
        ends.append((score(to_law(values), logs), values))
    error, values = min(ends, key=lambda pair: pair[0])
    return values, error


def fit_job(frozen: bytes, job: tuple[str, float, int]) -> Fit:
    """Fit a model to all logs but those of one gain."""
    import pickle

    (logs, evaluations), (model, gain, seed) = pickle.loads(frozen), job  # noqa: S301  from this command itself
    held = logs.kp == gain
    values, error = fit(model, logs.take(~held), evaluations, seed)
    return Fit(model, gain, values, error, score(to_law(values), logs.take(held)))


def tell(fits: Sequence[Fit]) -> str:
    """Return the table: a row a model, a column a held-out gain."""
    gains = sorted({fit.held_out for fit in fits})
    rows = []
    for model in dict.fromkeys(fit.model for fit in fits):
        own = {fit.held_out: fit for fit in fits if fit.model == model}
        errors = [1e3 * own[gain].checked for gain in gains]
        seen = 1e3 * float(np.mean([each.fitted for each in own.values()]))
        rows.append((model.upper(), *(f"{error:.1f}" for error in (*errors, float(np.mean(errors)), seen))))
    titles = ("model", *(f"kp {gain:g} held out" for gain in gains), "mean", "fitted")
    return f"{markdown(titles, rows)}\nMean absolute error of open-loop replays [mrad].\n"
