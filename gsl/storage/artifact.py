"""An artifact: a folder that one stage wrote whole, with a manifest that says how."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar, Protocol

import yaml

from gsl.core.budget import read_json, read_text
from gsl.core.console import Console
from gsl.core.interruption import checkpoint
from gsl.core.own_code import describe_own, package_of
from gsl.core.step_metrics import listen_to_steps
from gsl.core.trust import modules_in
from gsl.core.unit import Unit
from gsl.core.yaml_tree import yaml_tree
from gsl.effects.effect import own
from gsl.errors import ArtifactError, GslError, InputError
from gsl.storage import documents, manifest
from gsl.storage.identity import Identity, changes, content_hash, identify
from gsl.storage.lineage import REFRESH, broken_link, out_of_date
from gsl.storage.manifest import Manifest, Parent
from gsl.storage.origin import Origin, at_work, relative
from gsl.storage.read_files import own_effects, read_files
from gsl.storage.step_metrics import StepLog
from gsl.storage.versions import commit, versions
from gsl.storage.whole import explain_failures, flush_tree, remove_temporary
from gsl.storage.workplace import KEY, complete, hold_lock, install, log_to, stoppable, workplace

CONFIG = "config.yaml"
METRICS = "metrics.json"
LACKING = "lacking"
"""Among the metrics: the libraries for want of which a stage left something out, by the name to import."""


class Stage(Protocol):
    """What `build` needs of a stage.

    One that can be resumed sets `progress`, the file that it goes on from, and in `kept` what else it needs for that.
    One that builds parts itself sets `makes`: settings below which names of such parts (`identity.MADE`) mean nothing.
    """

    kind: ClassVar[str]

    def parents(self) -> Mapping[str, Path]:
        """Return what the stage reads, artifacts or files, by role: the dotted name of the setting that names it."""
        ...

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the results into `folder` and return the metrics."""
        ...


@dataclass(frozen=True)
class Artifact:
    """A complete artifact.

    Attributes:
        folder: Where it lies.
        manifest: How it came about.
        unchanged: Whether it was there already and no work had to be done.
    """

    folder: Path
    manifest: Manifest
    unchanged: bool = False

    @property
    def config(self) -> dict[str, Any]:
        """The resolved settings it was built with."""
        return self._read(CONFIG, lambda path: yaml_tree(path, read_text(path)))

    @property
    def metrics(self) -> dict[str, Any]:
        """The figures its stage reported; null where a number was not finite."""
        return self._read(self.manifest.metrics, read_json)

    def _read(self, name: str, read: Callable[[Path], Any]) -> dict[str, Any]:
        path = self._inside(name)
        try:
            stored = read(path)
        except (OSError, ValueError, InputError) as error:
            raise ArtifactError(path, f"is missing or damaged; {manifest.REMEDY}") from error
        if not (isinstance(stored, dict) and all(isinstance(name, str) for name in stored)):
            problem = f"is damaged: it holds no mapping of names; {manifest.REMEDY}"
            raise ArtifactError(path, problem)
        return stored

    def _inside(self, name: str) -> Path:
        """Return a file of the artifact, which does not lead out of it."""
        path = self.folder / name
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise ArtifactError(path, "leads out of the artifact; nothing of it is read")
        return path


def build(
    stage: Stage, *, config: Mapping[str, Any], out: Path, command: str, force: bool, console: Console
) -> Artifact:
    """Return the artifact of `stage` in `out`, building it unless it is there already.

    Args:
        stage: What to run.
        config: Its resolved settings.
        out: Folder of the artifact.
        command: Command line, for the manifest.
        force: Whether an artifact built otherwise, or damaged, may be replaced.
        console: Handed to the stage.

    Raises:
        ArtifactError: `out` is something else, or was built otherwise and `force` is not set, or is being built.
        GslError: The folder is full or cannot be written, or what the stage read was changed meanwhile.
    """
    if out.name in ("", ".."):
        raise ArtifactError(out, "is no folder for an artifact, which is replaced as a whole; choose another out=")
    if out.name.startswith("."):
        raise ArtifactError(out, "is hidden, as what killed commands leave is; choose another out=")
    sources = _sources(stage)
    package, made = package_of(type(stage)), getattr(stage, "makes", ())
    identity = identify(stage.kind, config, sources, package, made=made)
    for stale in filter(None, map(out_of_date, sources.values())):
        console.status(f"warning: {stale}; {REFRESH}")
    with hold_lock(out), stoppable(), explain_failures(out.parent):
        forced = getattr(stage, "forced", "rebuilds it")
        if (existing := _existing(out, identity, config, force=force, forced=forced)) is not None:
            os.utime(out / manifest.NAME)
            if (replaced := complete(out)) is not None:
                shutil.rmtree(replaced)
            note(existing)
            return existing
        if (left := complete(out)) is not None and (same := _intact(left, identity.key)) is not None:
            install(left, out)
            return note(Artifact(out, same))
        progress, kept = getattr(stage, "progress", ""), getattr(stage, "kept", ())
        with workplace(out, identity.key, progress=progress, kept=kept) as folder:
            made = _work(stage, identity, config, folder, out, command, console)
            manifest.write(folder, made)
            flush_tree(folder)
            install(folder, out)
    return note(Artifact(out, made))


_built: ContextVar[dict[Path, Artifact] | None] = ContextVar("built", default=None)
"""What the stage that is at work has built beside itself, by absolute path."""


def note(artifact: Artifact) -> Artifact:
    """Note an artifact as a link of the stage that is at work."""
    if (built := _built.get()) is not None:
        built[artifact.folder.absolute()] = artifact
    return artifact


@contextmanager
def collect_links() -> Iterator[Mapping[Path, Artifact]]:
    """Within, the artifacts that are built or are there already are collected, by absolute path."""
    links: dict[Path, Artifact] = {}
    token = _built.set(links)
    try:
        yield links
    finally:
        _built.reset(token)


def _intact(folder: Path, key: str) -> Manifest | None:
    """Return the manifest of a folder that is the artifact of this key and as it was written."""
    try:
        stored = manifest.read(folder)
    except ArtifactError:
        return None
    return stored if stored.key == key and manifest.find_damage(folder, stored) is None else None


def _existing(out: Path, identity: Identity, config: Mapping[str, Any], *, force: bool, forced: str) -> Artifact | None:
    """Return an artifact that is what is wanted; `forced` says what force=true does to one that is not."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return None
    try:
        artifact = Artifact(out, manifest.read(out), unchanged=True)
    except ArtifactError as error:
        if manifest.resembles(out):
            if force:
                return None
            raise
        raise ArtifactError(out, "exists and is no artifact of gsl; move it away or choose another out=") from error
    damaged, same = manifest.find_damage(out, artifact.manifest), artifact.manifest.key == identity.key
    broken = None if damaged else broken_link(out, artifact.manifest)
    whole = same and damaged is None and broken is None
    if whole and not _can_hold_more(artifact):
        return artifact
    if whole or force:
        return None
    if damaged:
        problem = f"is damaged: {damaged} {manifest.describe_damage(out, damaged)}"
    elif not same:
        problem = f"was built otherwise ({changes(artifact.manifest, artifact.config, identity, config)})"
    else:
        problem = f"is not whole any more: {broken}"
    raise ArtifactError(out, f"{problem}; force=true {forced}, another name= keeps both")


def _can_hold_more(artifact: Artifact) -> bool:
    """Return whether a library is here by now for want of which something was left out."""
    names = artifact.metrics.get(LACKING)
    return isinstance(names, list) and any(str(name).isidentifier() and find_spec(name) for name in names)


def _work(
    stage: Stage,
    identity: Identity,
    config: Mapping[str, Any],
    folder: Path,
    out: Path,
    command: str,
    console: Console,
) -> Manifest:
    begin = time.perf_counter()
    created = datetime.now(UTC).isoformat(timespec="seconds")
    settings = yaml.safe_dump(documents.plain(config), sort_keys=False, allow_unicode=True)
    (folder / CONFIG).write_text(settings, encoding="utf-8")
    with log_to(folder) as logger:
        logger.info("%s begins: %s", identity.kind, command)
        sources = _sources(stage).items()
        parents = tuple(Parent(role, relative(path, folder), identity.parents[role]) for role, path in sources)
        listening = listen_to_steps(StepLog(folder, identity.kind).note)
        with (
            collect_links() as links,
            at_work(Origin(command, settings, parents, folder, out, links)) as origin,
            listening,
        ):
            try:
                metrics = stage.run(folder, console)
            except SystemExit as error:  # of a user's own code: the work is not done, whatever the code says
                raise GslError(describe_own(error) or f"something has called sys.exit({error})") from error
        checkpoint()
        logger.info("%s ends after %.1f s", identity.kind, time.perf_counter() - begin)
    documents.write_json(folder / METRICS, metrics)
    _check_parents(stage, identity)
    remove_temporary(folder)  # of a worker that was killed
    return Manifest(
        kind=identity.kind,
        key=identity.key,
        command=command,
        files={name: file for name, file in manifest.inventory(folder).items() if name != KEY},
        parents=parents,
        links=origin.links,
        seeds=identity.seeds,
        sources=identity.sources,
        versions=versions(),
        git=commit(),
        created=created,
        duration=time.perf_counter() - begin,
        unit=_unit(stage),
        trust=_list_trust(stage, config),
    )


def _list_trust(stage: Stage, config: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the modules whose code took part and that are not gsl's."""
    effects = [kind.__module__ for kind in own().values()]
    return tuple(dict.fromkeys([*modules_in(config), *effects, *getattr(stage, "trust", ())]))


def _unit(stage: Stage) -> dict[str, Any] | None:
    task = getattr(getattr(stage, "iterate", stage), "task", None)
    return None if task is None else Unit.of(task)._asdict()


def _check_parents(stage: Stage, identity: Identity) -> None:
    """Refuse what is no longer as it was when the work began: it may be of either.

    Raises:
        GslError: A parent was changed meanwhile.
    """
    sources = _sources(stage)
    for role in sorted(identity.parents.keys() | sources.keys()):
        path = sources.get(role)
        try:
            same = path is not None and content_hash(path) == identity.parents.get(role)
        except (ArtifactError, OSError):
            same = False
        if not same:
            what = f"{role} ({path or 'gone'})"
            raise GslError(f"{what}: was changed while {identity.kind} was at work; run the command again")


def _sources(stage: Stage) -> dict[str, Path]:
    """Return all that a stage reads, by role: what its components read by themselves, such as a robot, included."""
    return {**read_files(stage), **own_effects(), **stage.parents()}
