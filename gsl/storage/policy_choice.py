"""Which parameters a stage starts from: a policy's own, or one that an artifact holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.described import describe
from gsl.core.interfaces import Policy
from gsl.errors import ArtifactError
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.identity import flat
from gsl.storage.policies import Policies, PolicyRecord, read_policies
from gsl.storage.references import resolve

FILE = "policies.json"
EVALUATION = "evaluation.json"  # of policies that were measured


def find_search(place: Path) -> Artifact | None:
    """Return the search whose policies a folder or file holds or a run has measured, None where it is of none.

    Raises:
        ArtifactError: What leads to it is incomplete, or a file of it is missing or was changed.
    """
    home = place if place.is_dir() else place.parent
    if not (home / manifest.NAME).is_file():
        return None
    made = manifest.read(home)
    if made.kind == "optimize":
        manifest.check_intact(home, made)
        return Artifact(home, made)
    above = [home / parent.path for parent in made.parents if made.kind == "evaluate" and parent.role == "policies"]
    above += [find_measurement(home)] if made.kind == "iterate" else []
    return next(filter(None, map(find_search, above)), None)


def find_measurement(run: Path) -> Path:
    """Return the measurement whose policy a run returned, the last one otherwise.

    Raises:
        ArtifactError: It has measured none, or what it returned is not as it was written.
    """
    made = manifest.read(run)
    manifest.check_intact(run, made, (FILE,))
    places = [run / link.path for link in made.links if link.role == "evaluate"]
    grounded = [place for place in places if place.name == "evaluate"] or places
    if not grounded:
        raise ArtifactError(run, "has measured no policy that could be shown")
    returned = (run / FILE).read_bytes()
    same = [place for place in grounded if (place / FILE).is_file() and (place / FILE).read_bytes() == returned]
    return (same or grounded)[-1]


@dataclass(frozen=True)
class PolicyChoice:
    """A policy family and the reference to the parameters, None for the family's start values."""

    policy: Policy
    reference: str | None

    def parents(self, role: str) -> Mapping[str, Path]:
        """Return what is read, by role."""
        return {} if self.reference is None else {role: resolve(self.reference)}

    def parameters(self) -> np.ndarray:
        """Return the parameters, shape (n_parameters,).

        Raises:
            ArtifactError: if the reference holds several policies.
        """
        if self.reference is None:
            return self.policy.initial
        stored = records(self.policy, self.reference)
        if len(stored) > 1:
            raise ArtifactError(self.reference, f"holds {len(stored)} policies; evaluate them and name that artifact")
        return vector(self.policy, stored[0])


def records(policy: Policy, reference: str) -> tuple[PolicyRecord, ...]:
    """Return the policies of a file or artifact.

    Raises:
        ArtifactError: if they are of another family.
    """
    path = resolve(reference)
    stored = read_policies(_file(path))
    if stored.policy != describe(policy):
        raise ArtifactError(path, f"its policies are others: {_difference(stored.policy, describe(policy))}")
    for name in stored.records[0].parameters.keys() ^ set(policy.names):
        raise ArtifactError(path, f"parameter {name}: not both the file and the policy know it; choose another policy=")
    return stored.records


def _file(path: Path) -> Path:
    if path.is_dir() and not (path / FILE).is_file():
        kind = manifest.read(path).kind
        raise ArtifactError(path, f"holds {kind}, which has no policies; name an artifact of optimize or evaluate")
    return path / FILE if path.is_dir() else path


def _difference(theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> str:
    """Return the first setting in which two policies differ."""
    left, right = flat(theirs), flat(ours)
    name = next(name for name in [*left, *right] if left.get(name) != right.get(name))
    what = "their class" if name == "_target_" else name
    return f"{what} is {left.get(name)}, but policy= here says {right.get(name)}"


def vector(policy: Policy, record: PolicyRecord) -> np.ndarray:
    """Return a record's parameters in the policy's order, shape (n_parameters,)."""
    return np.array([record.parameters[name] for name in policy.names])


def record(policy: Policy, name: str, parameters: np.ndarray, **more: Any) -> PolicyRecord:
    """Return parameters, shape (n_parameters,), as a record."""
    return PolicyRecord(name, dict(zip(policy.names, parameters.tolist(), strict=True)), **more)


def policies(policy: Policy, task: Any, stored: list[PolicyRecord]) -> Policies:
    """Return what a policy file holds."""
    return Policies(describe(policy), describe(task), tuple(stored))
