"""The files of a blind benchmark: cases that are handed out, labels that are not, answers that are sealed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from gsl.core.budget import read_json
from gsl.core.trajectory import Batch
from gsl.core.trust import check_code
from gsl.errors import ArtifactError
from gsl.storage.documents import write_json
from gsl.storage.references import resolve
from gsl.storage.trajectories import read, write
from gsl_benchmarks.blind.seals import VERSION, check_files, files_below

CASES, SEALS = "cases", "seals.json"  # of the data
LOG, REFERENCE, CASE = "log.parquet", "reference.parquet", "case.json"  # of a case
LABELS, SECRET = "labels.json", "secret.txt"  # of the labels
ANSWERS, BASELINES, SEAL = "answers", "baselines", "seal.json"  # of the answers


def find(reference: str, file: str, kind: str) -> Path:
    """Return a file of a folder that anyone wrote, or of the artifact of `kind` that a path or a run stands for."""
    place = Path(reference)
    folder = place if (place / file).is_file() else resolve(reference, kind=kind)
    if not (folder / file).is_file():
        raise ArtifactError(folder, f"holds no {file}; is this a folder of gsl {kind.replace('_', ' ')}?")
    return folder / file


def answers_below(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every answer in a folder of answers, those of the baselines by name of these."""
    hashes = files_below(folder / ANSWERS)
    for place in sorted((folder / BASELINES).glob("*")):
        hashes |= {f"{place.name}/{name}": sha for name, sha in files_below(place).items()}
    return hashes


def write_case(folder: Path, log: Batch, reference: Batch | None, case: Mapping[str, Any]) -> None:
    """Write a case's folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / LOG, log)
    if reference is not None:
        write(folder / REFERENCE, reference)
    write_json(folder / CASE, case)


def read_case(folder: Path, trust: Collection[str] = ()) -> tuple[Batch, Batch | None, dict[str, Any]]:
    """Return log, reference if there is one, and what case.json says; the code it names is of modules in `trust`.

    Raises:
        ArtifactError: It is no case.
        ConfigError: Its simulator is code of somebody else.
    """
    reference, case = folder / REFERENCE, document(folder / CASE, sim=dict)
    check_code(case, trust, where=folder.name)
    if not isinstance(case.get("without", []), list):
        raise ArtifactError(folder / CASE, "without is no list of effects; copy it again")
    return read(folder / LOG), read(reference) if reference.exists() else None, case


def seals_of(path: Path) -> dict[str, Any]:
    """Return the seals of all cases, by name, having checked that the cases' files are those that were sealed.

    Raises:
        GslError: A file was changed, is missing or is new.
    """
    cases: dict[str, Any] = document(path, cases=dict)["cases"]
    for name, seal in cases.items():
        if not (isinstance(seal, dict) and isinstance(seal.get("files"), dict) and isinstance(seal.get("label"), str)):
            raise ArtifactError(path, f"{name} is no seal of a case; copy it again")
        if name != Path(name).name or name.startswith("."):
            raise ArtifactError(path, f"{name} is no name of a case, which is a folder beside it")
        check_files(path.parent / CASES / name, seal["files"])
    return cases


def document(path: Path, **needed: type) -> dict[str, Any]:
    """Return a JSON document of this version, with or without a version number.

    Args:
        path: The file.
        needed: Kinds of the entries that it must have, by name.

    Raises:
        ArtifactError: It is damaged, of another version, or lacks an entry.
    """
    try:
        read_in: dict[str, Any] = read_json(path)
    except (OSError, ValueError) as error:
        raise ArtifactError(path, "cannot be read as JSON; copy it again") from error
    if not isinstance(read_in, dict) or read_in.get("schema_version", VERSION) != VERSION:
        raise ArtifactError(path, f"is of another version; this gsl reads {VERSION}")
    for name, kind in needed.items():
        if not isinstance(read_in.get(name), kind):
            raise ArtifactError(path, f"has no {name}, or what is none; copy it again")
    return read_in
