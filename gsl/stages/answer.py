"""An answer from elsewhere: logs and measurements that the runner has not written, taken in for a request."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import ArtifactError, TrajectoryError
from gsl.runner.journal import RETURNS, read_mark
from gsl.runner.request import NAME, read_request
from gsl.storage import trajectories
from gsl.storage.answer_checks import check_answers
from gsl.storage.answers import (
    STOPPED,
    check_lengths,
    check_mark,
    check_rate,
    csv_episodes,
    read_log,
    read_named,
    read_returns,
)
from gsl.storage.references import resolve

FILE = "answer.parquet"


@component
class Answer:
    """Checks logs with the columns of the contract, and measured returns, and puts them into the request's folder.

    The logged episodes are those of the request in order, unless `episodes` names them.
    """

    kind: ClassVar[str] = "answer"

    request: Annotated[str, setting("folder of the request", min_length=1)]
    logs: Annotated[str | None, setting("parquet or CSV file with the columns of the contract", min_length=1)] = None
    returns: Annotated[
        str | None, setting("CSV file: episode, distance in m or value, fell (yes or no)", min_length=1)
    ] = None
    episodes: Annotated[tuple[str, ...], setting("names of the logged episodes, in order; none for all of them")] = ()
    trust: Annotated[tuple[str, ...], setting("modules of your own whose policy the request may name")] = ()

    def parents(self) -> Mapping[str, Path]:
        """Return the request and the files that answer it."""
        read_request(Path(self.request), self.trust)
        files = {name: resolve(file) for name, file in (("logs", self.logs), ("returns", self.returns)) if file}
        return {**files, "request": Path(self.request) / NAME}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the answer in the form that a request's folder is searched for."""
        request = read_request(Path(self.request), self.trust)
        files = {role: path for role, path in self.parents().items() if role != "request"}
        if not files:
            raise ArtifactError(self.request, "there is nothing to take in: say logs=, returns= or both")
        answers = {}
        if self.returns:
            answers = read_returns(files["returns"], request)
            shutil.copyfile(files["returns"], folder / RETURNS)
        if self.logs:
            self._take_in(files["logs"], folder / FILE, request)
            logs = read_log(folder / FILE, request)
            check_lengths(files["logs"], request, logs, {name for name, answer in answers.items() if answer.fell})
            for line in check_answers(request, logs, files["logs"]):
                console.status(f"warning: {line}")
            answers = {**answers, **logs}
        missing = [episode["name"] for episode in request["episodes"] if episode["name"] not in answers]
        falls = sum(answer.fell for answer in answers.values())
        return {"episodes": len(answers), "asked": len(request["episodes"]), "falls": falls, "missing": missing}

    def _take_in(self, source: Path, out: Path, request: Mapping[str, Any]) -> None:
        """Write the logged episodes by the names that the request has for them."""
        marked, episodes = _csv(source, request) if source.suffix == ".csv" else _parquet(source, request)
        asked = {episode["name"]: episode for episode in request["episodes"]}
        names = self.episodes or marked or tuple(asked)
        for name, episode in read_named(source, names, episodes, request).items():
            check_rate(source, name, episode, request)
        about = {"robot": request["robot"], "role": "real", "source": source.name, "request": request["hash"]}
        labels = [{"name": name, "policy": asked[name]["policy"]} for name in names]
        joints, period = tuple(request["joints"]), request["control_period"]
        trajectories.write(out, Batch(tuple(episodes), joints, period, {**about, "episodes": labels}))


def _csv(source: Path, request: Mapping[str, Any]) -> tuple[tuple[str, ...], list[Trajectory]]:
    """Return the names, if it is the runner's own, and the episodes of a file; a stop for safety is a fall."""
    if mark := read_mark(source):
        check_mark(source, mark, request)
    by_name = list(csv_episodes(source, request))
    names, episodes = tuple(name for name, _ in by_name) if mark else (), [episode for _, episode in by_name]
    return names, [
        replace(episode, fell=_down(episode), sensors=_without(episode.sensors, STOPPED)) for episode in episodes
    ]


def _down(episode: Trajectory) -> np.ndarray:
    down = np.zeros(len(episode) + 1, dtype=bool) if episode.fell is None else episode.fell
    return down | np.asarray(episode.sensors.get(STOPPED, down), dtype=bool)


def _without(sensors: Mapping[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    return {key: values for key, values in sensors.items() if key != name}


def _parquet(source: Path, request: Mapping[str, Any]) -> tuple[tuple[str, ...], list[Trajectory]]:
    """Return the names, if it says what it answers, and the episodes of a file, joints in the request's order."""
    batch = trajectories.read(source, joints=tuple(request["joints"]))
    names: tuple[str, ...] = ()
    if mark := str(batch.metadata.get("request", "")):
        check_mark(source, mark, request)
        names = tuple(str(label.get("name", "")) for label in batch.metadata.get("episodes", []))
    if missing := [joint for joint in request["joints"] if joint not in batch.joints]:
        raise TrajectoryError(source, f"the joint {missing[0]} was asked for, but is not in it")
    if abs(batch.control_period - request["control_period"]) > 1e-9:
        rates = f"a row every {batch.control_period:g} s, but {request['control_period']:g} s were asked for"
        raise TrajectoryError(source, f"has {rates}; resample it")
    order = [batch.joints.index(joint) for joint in request["joints"]]
    return names, [
        replace(
            episode,
            action=episode.action[:, order],
            position=episode.position[:, order],
            velocity=episode.velocity[:, order],
            grounded_action=None if episode.grounded_action is None else episode.grounded_action[:, order],
        )
        for episode in batch.episodes
    ]
