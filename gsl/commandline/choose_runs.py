"""Which artifacts `gsl runs` lists, and in what order: by kind, name, world, metric and age."""

from __future__ import annotations

import fnmatch
import math
import operator
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Annotated, Any

from gsl.commandline.words import read_span
from gsl.commandline.world_names import name_world
from gsl.core.setting import component, setting
from gsl.core.unit import Unit
from gsl.core.validation import did_you_mean
from gsl.errors import ArtifactError, ConfigError
from gsl.report.headline import show_in_unit, title_in_unit, unit_of
from gsl.storage.artifact import Artifact
from gsl.storage.identity import flat
from gsl.storage.references import RUNS, name_run

LISTED = 12  # metrics in a message: what fits in two lines of a terminal
ROLES = ("world", "sim", "real")
_CONDITION = re.compile(r"([^<>=!]+?)(?:(<=|>=|==|!=|<|>)([^<>=!]+))?")
_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip


@component
class Choice:
    """What `gsl runs` takes."""

    kind: Annotated[str, setting("kinds of artifact, with commas between: iterate,optimize")] = ""
    name: Annotated[str, setting("part of the reference, or a pattern with *")] = ""
    world: Annotated[str, setting("one of its worlds, or a robot or effect of them")] = ""
    metric: Annotated[str, setting("a metric that it has, or a condition, in the unit shown: 'returned.value>20'")] = ""
    newer: Annotated[str, setting("made within this time: 90s, 30min, 12h, 7d, 2w")] = ""
    older: Annotated[str, setting("made before this time")] = ""
    sort: Annotated[str, setting("made, took, name, kind or a metric; -NAME turns it round")] = ""
    limit: Annotated[int, setting("so many rows: the first with sort=, else the newest; 0 for all", ge=0)] = 0


@dataclass(frozen=True)
class Run:
    """An artifact as the list sees it."""

    artifact: Artifact

    @property
    def name(self) -> str:
        """Its reference."""
        return name_run(self.artifact.folder)

    @cached_property
    def metrics(self) -> dict[str, float]:
        """Its finite metrics by dotted name; of a damaged artifact none."""
        try:
            values = flat(self.artifact.metrics)
        except ArtifactError:
            return {}
        return {name: float(value) for name, value in values.items() if _is_number(value)}

    @property
    def unit(self) -> Unit:
        """Of its task."""
        return unit_of(self.artifact)

    @cached_property
    def figures(self) -> dict[str, float]:
        """Its metrics as people are shown them: values of its task in the task's unit."""
        return dict(zip(self.metrics, show_in_unit(self.metrics, self.unit).values(), strict=True))

    @cached_property
    def worlds(self) -> set[str]:
        """Names of its worlds, those in its command first of all, and their robots and effects."""
        words = (word.lstrip("+").partition("=") for word in self.artifact.manifest.command.split())
        names = {value for key, _, value in words if key in ROLES}
        try:
            config = self.artifact.config
        except ArtifactError:
            return names
        for world in (config.get(role) for role in ROLES):
            if isinstance(world, Mapping):
                names |= name_world(world)
                names |= {str(world.get("robot", "")), *map(str, world.get("effects") or ())}
        return names - {""}


def choose(artifacts: Sequence[Artifact], choice: Choice, now: datetime) -> tuple[list[Run], str | None]:
    """Return the artifacts that fit, in order, and the metric that is shown beside them.

    Raises:
        ConfigError: A time, condition or order cannot be read, or nothing has such a kind, world or metric.
    """
    runs = [Run(artifact) for artifact in artifacts]
    asked, condition = _read_condition(choice.metric)
    least, most = (read_span(name, text) if (text := getattr(choice, name)) else None for name in ("older", "newer"))
    kinds = _check_words("kind", choice.kind, {run.artifact.manifest.kind for run in runs})
    worlds = _check_words("world", choice.world, {name for run in runs for name in run.worlds} if choice.world else ())
    runs = [
        run
        for run in runs
        if (not kinds or run.artifact.manifest.kind in kinds)
        and _fits_name(run.name, choice.name)
        and (not worlds or worlds & run.worlds)
        and _fits_age(run, now, least, most)
    ]
    if asked:
        asked = _find_metric("metric", asked, runs)
        runs = [run for run in runs if asked in run.figures and condition(run.figures[asked])]
    key = choice.sort.removeprefix("-") or "made"
    if key not in _ORDERS:
        key = _find_metric("sort", key, runs, more=tuple(_ORDERS))
        runs = [run for run in runs if key in run.metrics]
    order = _ORDERS.get(key, lambda run: run.figures[key])
    runs = sorted(runs, key=order, reverse=choice.sort.startswith("-"))
    if choice.limit:
        runs = runs[: choice.limit] if choice.sort else runs[-choice.limit :]
    return runs, asked or (None if key in _ORDERS else key)


_ORDERS: Mapping[str, Callable[[Run], Any]] = {
    "made": lambda run: (run.artifact.manifest.created, run.artifact.folder),
    "took": lambda run: run.artifact.manifest.duration,
    "name": lambda run: run.name,
    "kind": lambda run: (run.artifact.manifest.kind, run.artifact.manifest.created),
}


def _read_condition(text: str) -> tuple[str, Callable[[float], bool]]:
    if not text:
        return "", lambda value: True
    parts = _CONDITION.fullmatch(text.strip())
    try:
        if parts is None:
            raise ValueError
        name, sign, bound = parts[1].strip(), parts[2], float(parts[3]) if parts[2] else 0.0
    except ValueError:
        raise ConfigError("metric", "must be a name, or a condition such as 'falls<=2'", given=text) from None
    return name, (lambda value: _COMPARE[sign](value, bound)) if sign else (lambda value: True)


def _check_words(setting: str, text: str, there: Collection[str]) -> set[str]:
    words = {word for word in text.split(",") if word}
    for word in sorted(words - set(there)):
        raise ConfigError(setting, f"no artifact below {RUNS}/ has it{did_you_mean(word, there)}", given=word)
    return words


def _find_metric(setting: str, name: str, runs: Sequence[Run], more: tuple[str, ...] = ()) -> str:
    """Return the name of a metric, which may be asked for with its unit, as the list shows it."""
    names = {metric for run in runs for metric in run.metrics}
    titles = {title_in_unit(metric, run.unit): metric for run in runs for metric in run.metrics}
    if runs and name not in names | titles.keys():
        ends = sorted(metric for metric in names if name in metric.split("."))[:3]
        near = f"; did you mean {' or '.join(ends)}?" if ends else did_you_mean(name, {*names, *more})
        near = f"{near} There" if near.startswith("; did") else "; there"
        raise ConfigError(setting, f"none of these artifacts has this metric{near} {_list(runs)}", given=name)
    return name if name in names else titles.get(name, name)


def find_deeper(name: str, runs: Sequence[Run]) -> list[str]:
    """Return metrics whose last word is the name of another: `returned.falls` of `falls`."""
    return sorted({metric for run in runs for metric in run.metrics if name != metric and metric.endswith(f".{name}")})


def _list(runs: Sequence[Run]) -> str:
    """Return the metrics that there are: those of most artifacts, if they are many."""
    counts = Counter(metric for run in runs for metric in run.metrics)
    if not counts:
        return "is none"
    most = sorted(counts, key=lambda metric: (-counts[metric], metric.count("."), metric))[:LISTED]
    rest = len(counts) - len(most)
    return f"is {', '.join(most)}" + (f" and {rest} more, see gsl show REF --json" if rest else "")


def _fits_name(name: str, pattern: str) -> bool:
    return fnmatch.fnmatchcase(name, pattern) if "*" in pattern else pattern in name


def _fits_age(run: Run, now: datetime, least: float | None, most: float | None) -> bool:
    age = (now - datetime.fromisoformat(run.artifact.manifest.created)).total_seconds()
    return (least is None or age >= least) and (most is None or age <= most)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
