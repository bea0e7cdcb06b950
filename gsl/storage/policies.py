"""Policy files: the parameters of the policies a search found, as JSON a person can read and write."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gsl.errors import ArtifactError
from gsl.storage import documents

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class PolicyRecord:
    """One policy.

    Attributes:
        name: Such as `generation_03`.
        parameters: Value of each parameter by name, in the policy's units.
        generation: Generation of the search that found it, if one did.
        value_sim: Its value in simulation, in the task's units, if it was measured.
        notes: Whatever else is known of it.
    """

    name: str
    parameters: Mapping[str, float]
    generation: int | None = None
    value_sim: float | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Policies:
    """What one policy file holds.

    Attributes:
        policy: Settings of the policy the parameters belong to, with its `_target_`.
        task: Settings or name of the task they were found for.
        records: The policies, in the order of the file.
    """

    policy: Mapping[str, Any]
    task: Mapping[str, Any] | str
    records: tuple[PolicyRecord, ...]

    def __len__(self) -> int:
        """Number of policies."""
        return len(self.records)


def write_policies(path: Path, policies: Policies) -> None:
    """Write a policy file, whole or not at all; numbers come back as they were, to the bit.

    Raises:
        ArtifactError: A number is not finite, a name occurs twice, or the records have different parameters.
    """
    entries = [{**vars(record), "parameters": dict(record.parameters)} for record in policies.records]
    stored = {"schema_version": SCHEMA_VERSION, "policy": policies.policy, "task": policies.task, "policies": entries}
    _check(path, policies)
    documents.write_json(path, stored)


def read_policies(path: Path) -> Policies:
    """Read a policy file.

    Raises:
        ArtifactError: It is missing, damaged, of another version, or a number in it is not finite.
    """
    damaged = "is not a policy file, or damaged; write it again with gsl optimize"
    stored = documents.read_versioned(path, SCHEMA_VERSION, damaged)
    try:
        records = tuple(PolicyRecord(**entry) for entry in stored["policies"])
        policies = Policies(stored["policy"], stored["task"], records)
    except (KeyError, TypeError) as error:
        raise ArtifactError(path, f"an entry is missing or unknown: {error}") from error
    return _check(path, policies)


def _check(path: Path, policies: Policies) -> Policies:
    if not policies.records:
        raise ArtifactError(path, "there is no policy in it")
    if not isinstance(policies.policy, Mapping) or "_target_" not in policies.policy:
        raise ArtifactError(path, "policy: has no _target_, so nobody knows what the parameters belong to")
    names = [record.name for record in policies.records]
    if double := sorted({str(name) for name in names if names.count(name) > 1}):
        raise ArtifactError(path, f"{double[0]} occurs twice; give every policy its own name")
    for record in policies.records:
        _check_record(path, record, policies.records[0])
    return policies


def _check_record(path: Path, record: PolicyRecord, first: PolicyRecord) -> None:
    if not isinstance(record.name, str) or not isinstance(record.parameters, Mapping):
        raise ArtifactError(path, f"{record.name}: a policy needs a name and its parameters by name")
    if not isinstance(record.notes, Mapping) or type(record.generation) not in (int, type(None)):
        raise ArtifactError(path, f"{record.name}: its generation is no whole number, or its notes have no names")
    if different := sorted(record.parameters.keys() ^ first.parameters.keys()):
        raise ArtifactError(path, f"{record.name}: differs from {first.name} in having {different[0]}")
    values = {**record.parameters} | ({} if record.value_sim is None else {"value_sim": record.value_sim})
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ArtifactError(path, f"{record.name}: {name} = {value!r} is not a finite number")
