"""References: everywhere a path is asked for, the name of a run serves as well."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from gsl.core.likeness import find_alike
from gsl.errors import ArtifactError
from gsl.storage import manifest
from gsl.storage.artifact import Artifact

RUNS = Path("runs")
MAKERS = {
    "collect_real": "collect",
    "collect_sim": "collect role=sim",
    "train_forward": "train-forward",
    "train_inverse": "train-inverse",
    "train_servo": "train-servo",
    "train_grounding": "train-grounding",
    "optimize": "optimize",
}
"""Commands that make an artifact of a run, by the name that it has there."""
SIDES = {"collect_real", "collect_sim"}
ALIKE = 0.8  # evaluat is evaluate; evaluate_none is not
CHOICES = 20  # of artifacts in a message
ALTERNATIVES = 3  # of the same name further down in a run: those of its first iterations


def resolve(
    reference: str | Path, *, kind: str | tuple[str, ...] | None = None, runs: Path = RUNS, side: str = ""
) -> Path:
    """Return what `reference` names: a file, an artifact, or the only artifact of `kind` below a folder or a run.

    Args:
        reference: A path, or the name of a run in `runs`, which may go on into it: `quick-start/optimize`.
        kind: What the artifact has to be, or one of several; None takes any.
        runs: Folder of the runs.
        side: `real` or `sim`: which is meant of a run that has collected on both and has nothing else of the kind.

    Raises:
        ArtifactError: There is no such thing, it is of another kind, or several fit.
    """
    kinds = (kind,) if isinstance(kind, str) else kind
    wanted = " or ".join(kinds or ())
    place = _place(str(reference), runs)
    if place.is_file():
        return place
    if (place / manifest.NAME).is_file():
        manifest.read(place)
    artifacts = _artifacts(place)
    own = [artifact for artifact in artifacts if artifact.folder == place]
    if own and (kinds is None or own[0].manifest.kind in kinds):
        return place
    fitting = [artifact for artifact in artifacts if kinds is None or artifact.manifest.kind in kinds]
    if len(fitting) == 1:
        return fitting[0].folder
    sides = {artifact.folder.name: artifact.folder for artifact in fitting if artifact.folder.parent == place}
    if side and sides.keys() == SIDES and len(fitting) == len(SIDES):
        return sides[f"collect_{side}"]
    if fitting:
        choices = ", ".join(name_run(artifact.folder, runs) for artifact in fitting[:CHOICES])
        choices += f" and {len(fitting) - CHOICES} more" if len(fitting) > CHOICES else ""
        raise ArtifactError(reference, f"several artifacts fit, name one of them: {choices}")
    if own:
        raise ArtifactError(place, f"holds {own[0].manifest.kind}, but {wanted} is needed")
    there = ", ".join(sorted({artifact.manifest.kind for artifact in artifacts})) or "no complete artifact"
    raise ArtifactError(place, f"holds {there}" + (f", but {wanted} is needed" if kind else "; build one in it first"))


def load(reference: str | Path, kind: str, *, runs: Path = RUNS) -> Artifact:
    """Return the artifact that `reference` names, after a check that it is complete and as it was written.

    Raises:
        ArtifactError: There is none of this kind, or a file of it is missing or was changed.
    """
    folder = resolve(reference, kind=kind, runs=runs)
    artifact = Artifact(folder, manifest.read(folder))
    if artifact.manifest.kind != kind:
        raise ArtifactError(folder, f"holds {artifact.manifest.kind}, but {kind} is needed")
    manifest.check_intact(folder, artifact.manifest)
    return artifact


def find_all(runs: Path = RUNS) -> list[Artifact]:
    """Return the complete artifacts below `runs`, oldest first."""
    return sorted(_artifacts(runs), key=lambda artifact: (artifact.manifest.created, artifact.folder))


def resolve_main(reference: str, *, kind: str | tuple[str, ...] | None = None) -> Path:
    """Return the folder of the artifact that is meant: of a whole run its main one.

    That is its `iterate`, else the only artifact of `kind`, else the only one directly in the folder of the run, such
    as its `compare`, which has built those below.

    Raises:
        ArtifactError: There is no such artifact, or several fit.
    """
    try:
        place = resolve(reference, kind="iterate")
    except ArtifactError:
        try:
            place = resolve(reference, kind=kind)
        except ArtifactError:
            run = _place(reference, RUNS)
            kinds = (kind,) if isinstance(kind, str) else kind
            near = [each for each in _artifacts(run) if each.folder.parent == run]
            if len(near) != 1 or (kinds and near[0].manifest.kind not in kinds):
                raise
            place = near[0].folder
    return place.parent if place.is_file() else place


def artifact_folders(reference: str | None = None, *, runs: Path = RUNS) -> list[Path]:
    """Return the folders of all artifacts that `reference` names, below runs/ without one, damaged ones as well.

    Raises:
        ArtifactError: There is none.
    """
    place = runs if reference is None else _place(reference, runs)
    if (place / manifest.NAME).is_file():
        return [place]
    folders = [folder for folder, _ in _walk(place)]
    if reference is not None and not folders:
        raise ArtifactError(place, "holds no complete artifact; build one in it first")
    return folders


def find_damaged(runs: Path = RUNS) -> list[Path]:
    """Return the folders below `runs` that were artifacts, but whose manifest cannot be read."""
    return [folder for folder, stored in _walk(runs) if stored is None and manifest.resembles(folder)]


def _place(reference: str, runs: Path) -> Path:
    if not reference:
        raise ArtifactError("''", "is empty; give a path or the name of a run")
    for place in (Path(reference), runs / reference):
        if place.is_file() or (place / manifest.NAME).is_file():
            return place
    for place in (runs / reference, Path(reference)):
        if place.is_dir():
            return place
    raise ArtifactError(reference, f"there is no such path and no such run in {runs}{_alternatives(reference, runs)}")


def _alternatives(reference: str, runs: Path) -> str:
    run, _, stage = reference.rpartition("/")
    inside = [name_run(artifact.folder, runs) for artifact in _artifacts(runs)]
    last = {name: name.rpartition("/")[2] for name in inside if run and name.startswith(f"{run}/")}
    if meant := find_alike(stage, sorted({*last.values()}), cutoff=ALIKE):
        deeper = [name for name in last if last[name] == meant[0]]
        return f", did you mean {' or '.join(deeper[:ALTERNATIVES])}?"
    maker = f"; gsl {MAKERS[stage]} name={run} makes it" if run and stage in MAKERS else ""
    there = runs.iterdir() if runs.is_dir() else ()
    names = {path.name for path in there if path.exists() and not path.name.startswith(".")}
    close = find_alike(reference, sorted({*names, *inside}), cutoff=0.85 if maker else 0.6)
    return f", did you mean {close[0]}?" if close else maker


def _artifacts(folder: Path) -> list[Artifact]:
    return [Artifact(place, stored) for place, stored in _walk(folder) if stored is not None]


def _walk(folder: Path) -> Iterator[tuple[Path, manifest.Manifest | None]]:
    """Yield every folder with a manifest, or with all that an artifact has beside it, and that, None if unreadable."""
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        if manifest.NAME in files or {*files} >= manifest.ALWAYS:
            yield Path(place), _readable(Path(place))


def _readable(folder: Path) -> manifest.Manifest | None:
    try:
        return manifest.read(folder)
    except ArtifactError:
        return None


def name_run(folder: Path, runs: Path = RUNS) -> str:
    """Return the name of a run's folder as a reference."""
    return (folder.relative_to(runs) if folder.is_relative_to(runs) else folder).as_posix()
