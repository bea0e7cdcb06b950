"""Real returns: policies that an evaluation, or every iteration of `iterate`, has measured in the real world."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.budget import read_json
from gsl.core.described import restore
from gsl.core.interfaces import Policy, Task
from gsl.core.setting import settings_of
from gsl.errors import ArtifactError
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.documents import as_written
from gsl.storage.identity import content_hash
from gsl.storage.policies import read_policies
from gsl.storage.policy_choice import EVALUATION, FILE, records, vector
from gsl.storage.references import resolve
from gsl.worlds.bullet import BulletWorld

MOST_ROUNDS = 1000  # of an iteration
MOST = 12  # policies that are compared; of more, some are taken that are spread over the list
ROLE, FOUND = "policies", "found"
_EVALUATE, _ITERATE = "evaluate", "iterate"
_SETUP = ("floating", "start_noise", "settle")  # how an episode begins belongs to the measurement


class MeasuredPolicy(NamedTuple):
    """A policy with its real returns.

    Attributes:
        name: Of the policy, with its iteration where there are several.
        parameters: Shape (n_parameters,).
        values: Real returns, one an episode, shape (n_episodes,).
        falls: How many of them ended in a fall.
        stopped: Whether there would have been more episodes but for its first fall.
    """

    name: str
    parameters: np.ndarray
    values: np.ndarray
    falls: int
    stopped: bool


@dataclass(frozen=True)
class RealReturns:
    """What was measured, and how.

    Attributes:
        task: What the returns are of.
        policy: Family of the policies.
        world: Settings of the real world.
        policies: Those that are compared.
        total: How many were measured.
    """

    task: Task
    policy: Policy
    world: Mapping[str, Any]
    policies: tuple[MeasuredPolicy, ...]
    total: int

    def setup(self, sim: BulletWorld) -> BulletWorld:
        """Return the simulator with episodes that begin as the real ones did: in the air or on the ground, and so on.

        Settings that the real world does not have, if it is not of our kind, stay those of the simulator.
        """
        ours = self.world.get("_target_") == f"{BulletWorld.__module__}.{BulletWorld.__qualname__}"
        defaults = {name: option.default for name, option in settings_of(BulletWorld).items()} if ours else {}
        settings = defaults | dict(self.world)
        return replace(sim, **{name: settings[name] for name in _SETUP if name in settings})


def list_parents(reference: str) -> dict[str, Path]:
    """Return the artifacts that are read, by role: the one that is named, the evaluations in it, what these measured.

    Raises:
        ArtifactError: There is no such artifact, it holds no real returns, or a part of it is gone or has changed.
    """
    named = _resolve(reference)
    if manifest.read(named).kind != _ITERATE:
        return {ROLE: named, f"{ROLE}.{FOUND}": _source(named)}
    parents = {ROLE: named}
    for place in _iterations(named):
        parents |= {f"{ROLE}.{place.parent.name}": place, f"{ROLE}.{place.parent.name}.{FOUND}": _source(place)}
    return parents


def real_returns(reference: str, sim: BulletWorld, *, trust: Collection[str] = ()) -> RealReturns:
    """Return the policies of an artifact of `evaluate` or `iterate` with their real returns, at most `MOST`.

    Raises:
        ArtifactError: There is none, or its policies are of another robot, task or control period than the simulator.
        ConfigError: It names a class that is not gsl's, and whose module is not in `trust`.
    """
    named = _resolve(reference)
    with as_written(named, "evaluate again"):
        return _read(named, sim, trust)


def _read(named: Path, sim: BulletWorld, trust: Collection[str]) -> RealReturns:
    places = _iterations(named) if manifest.read(named).kind == _ITERATE else [named]
    configs = [_check(place, sim) for place in places]
    config = configs[-1]
    policy = restore(config["policy"], trust=trust, where="policies.policy")
    task = restore(config["task"], trust=trust, where="policies.task")
    policies: list[MeasuredPolicy] = []
    for place, settings in zip(places, configs, strict=True):
        rows = _measure(place, policy, settings["episodes"], f"{place.parent.name}/" if len(places) > 1 else "")
        policies += rows[1:] if policies else rows  # a later evaluation begins with what the one before has returned
    for measured in policies:
        policy.posture(measured.parameters, sim.layout)
    chosen = np.unique(np.linspace(0, len(policies) - 1, min(MOST, len(policies))).round().astype(int))
    return RealReturns(task, policy, config["world"], tuple(policies[k] for k in chosen), len(policies))


def _resolve(reference: str) -> Path:
    """Return the artifact; a run that has both an `iterate` and evaluations stands for the former."""
    try:
        place = resolve(reference, kind=_ITERATE)
    except ArtifactError:
        place = resolve(reference, kind=_EVALUATE)
    if place.is_file():
        raise ArtifactError(place, "holds no real returns; name an artifact of evaluate or iterate")
    return place


def _iterations(named: Path) -> list[Path]:
    """Return the evaluations beside an artifact of `iterate`."""
    with as_written(named, "iterate again"):
        count = int(Artifact(named, manifest.read(named)).metrics["iterations"])
    return [named.parent / f"iteration_{number:02d}" / _EVALUATE for number in range(1, min(count, MOST_ROUNDS) + 1)]


def _source(evaluation: Path) -> Path:
    """Return the policies that an evaluation has measured, if they still are what they were."""
    parents = {parent.role: parent for parent in manifest.read(evaluation).parents}
    if ROLE not in parents:
        raise ArtifactError(evaluation, "measured one policy alone, so that there is nothing to rank")
    made_from = parents[ROLE]
    source = Path(os.path.normpath(evaluation / made_from.path))
    if not source.exists():
        raise ArtifactError(source, f"is gone, but {evaluation} has measured its policies; evaluate again")
    if content_hash(source) != made_from.hash:
        raise ArtifactError(source, f"has changed since {evaluation} measured its policies; evaluate again")
    return source


def _check(evaluation: Path, sim: BulletWorld) -> dict[str, Any]:
    """Return the settings of an evaluation that the simulator can repeat."""
    config = Artifact(evaluation, manifest.read(evaluation)).config
    world, task = config["world"], config["task"]
    robot, period = world.get("robot", sim.robot), world.get("period", sim.period)
    if robot != sim.robot:
        raise ArtifactError(evaluation, f"its policies are of another robot: {robot}, but sim= is the {sim.robot}")
    if abs(period - sim.period) > 1e-9:
        raise ArtifactError(evaluation, f"its policies act every {period:g} s, but sim= every {sim.period:g} s")
    found_for = read_policies(_file(_source(evaluation))).task
    if isinstance(found_for, Mapping) and found_for.get("_target_") != task["_target_"]:
        tasks = [str(settings.get("_target_")).rpartition(".")[2] for settings in (found_for, task)]
        raise ArtifactError(
            evaluation, f"its policies are of another task: found for {tasks[0]}, measured at {tasks[1]}"
        )
    return config


def _file(source: Path) -> Path:
    return source if source.is_file() else source / FILE


def _measure(evaluation: Path, policy: Policy, episodes: int, prefix: str) -> list[MeasuredPolicy]:
    """Return all policies of one evaluation; fresh episodes count instead of the `episodes` by which one was chosen."""
    table = read_json(evaluation / EVALUATION)
    fresh = {row["name"]: row for row in table["confirmation"]}
    thetas = {record.name: vector(policy, record) for record in records(policy, str(_source(evaluation)))}
    return [
        MeasuredPolicy(
            f"{prefix}{row['name']}",
            thetas[row["name"]],
            np.array(fresh.get(row["name"], row)["values"]),
            fresh.get(row["name"], row)["falls"],
            row["falls"] > 0 and row["name"] not in fresh and row["episodes"] < episodes,
        )
        for row in table["policies"]
    ]
