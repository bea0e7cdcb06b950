from __future__ import annotations

import ctypes
import errno
import fcntl
import importlib.util
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from gsl.commandline.failure import describe_failure
from gsl.errors import ArtifactError, GslError
from gsl.storage import hashing, manifest
from gsl.storage.artifact import LACKING, Artifact, build
from gsl.storage.documents import write_json
from gsl.storage.identity import Identity, changes
from gsl.storage.lineage import out_of_date
from gsl.storage.workplace import complete

pytestmark = pytest.mark.slow


@dataclass
class Doubling:
    """A stage that writes its number twice."""

    number: int = 1
    data: Path | None = None
    ending: Callable[[Path], None] = lambda folder: None
    calls: list[Path] = field(default_factory=list)
    kind: ClassVar[str] = "doubling"

    def parents(self) -> Mapping[str, Path]:
        return {} if self.data is None else {"data": self.data}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        self.calls.append(folder)
        (folder / "sub").mkdir(exist_ok=True)
        (folder / "sub" / "payload.txt").write_text(f"{self.number}{self.number}")
        logging.getLogger("gsl.doubling").info("half way")
        self.ending(folder)
        return {"double": 2 * self.number, "spread": float("nan")}


class Resumable(Doubling):
    """The same, going on where it was killed."""

    progress: ClassVar[str] = "progress"


def built(stage: Doubling, out: Path, *, force: bool = False, **settings: Any) -> Artifact:
    config = {"_target_": "Doubling", "number": stage.number, "seed": 7, "data": str(stage.data), **settings}
    if stage.data is None:
        del config["data"]
    return build(stage, config=config, out=out, command="gsl doubling", force=force, console=None)


def hidden(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


def raising(error: BaseException) -> Callable[[Path], None]:
    def ending(folder: Path) -> None:
        raise error

    return ending


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "runs" / "quick" / "doubling"


def test_an_artifact_holds_all_that_the_contract_names(out: Path) -> None:
    made = built(Doubling(), out)
    assert not made.unchanged
    assert made.manifest == manifest.read(out)
    assert set(made.manifest.files) == {"config.yaml", "log.txt", "metrics.json", "sub/payload.txt"}
    assert made.metrics == {"double": 2, "spread": None}
    assert made.config == {"_target_": "Doubling", "number": 1, "seed": 7}
    assert "half way" in (out / "log.txt").read_text()
    stored = json.loads((out / "manifest.json").read_text())
    assert stored["seeds"] == {"seed": 7}
    assert stored["versions"].keys() >= {"gsl", "python", "numpy", "pybullet", "torch", "cma", "pandas", "pyarrow"}
    assert stored["files"]["sub/payload.txt"] == {"sha256": hashing.file_hash(out / "sub/payload.txt"), "bytes": 2}
    assert {path.name for path in out.iterdir()} == {"config.yaml", "log.txt", "manifest.json", "metrics.json", "sub"}
    assert not hidden(out.parent)


@pytest.mark.parametrize("text", ["null: 1\n", "3: 1\n", "- 1\n", "a: [\n"])
def test_settings_that_are_no_mapping_of_names_are_damaged(text: str, out: Path) -> None:
    made = built(Doubling(), out)
    (out / "config.yaml").write_text(text)
    with pytest.raises(ArtifactError, match="config.yaml: is .*damaged.*force=true"):
        _ = made.config


def test_the_same_work_is_not_done_twice_but_looks_fresh(out: Path) -> None:
    built(Doubling(), out)
    os.utime(out / "manifest.json", (0, 0))
    stage = Doubling()
    again = built(stage, out, force=True)
    assert again.unchanged
    assert not stage.calls
    assert time.time() - (out / "manifest.json").stat().st_mtime < 60


def test_what_was_left_out_for_want_of_a_library_is_made_when_it_is_there(
    out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Writer(Doubling):
        def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
            lacking = [] if importlib.util.find_spec("wanted") else ["wanted"]
            return {**super().run(folder, console), LACKING: lacking}

    assert built(Writer(), out).metrics[LACKING] == ["wanted"]
    assert built(Writer(), out).unchanged
    (tmp_path / "wanted.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    made = built(Writer(), out)
    assert (made.unchanged, made.metrics[LACKING]) == (False, [])
    assert built(Writer(), out).unchanged


def test_only_a_component_has_workers_that_change_nothing(out: Path) -> None:
    robot = {"_target_": "Robot", "requests": 1}
    built(Doubling(), out, workers=1, world=robot, kwargs={"workers": 1})
    again = built(Doubling(), out, workers=2, world={**robot, "requests": 2}, kwargs={"workers": 1})
    assert again.unchanged
    with pytest.raises(ArtifactError, match=r"changed: kwargs\.workers 1 -> 2"):
        built(Doubling(), out, workers=1, world=robot, kwargs={"workers": 2})


def test_a_changed_setting_is_refused_by_name(out: Path) -> None:
    built(Doubling(), out, world={"period": 0.02})
    stage = Doubling(2)
    with pytest.raises(ArtifactError, match=r"number 1 -> 2, world\.period 0\.02 -> 0\.01.*force=true"):
        built(stage, out, world={"period": 0.01})
    assert not stage.calls
    with pytest.raises(ArtifactError, match=r"a 1 -> 2, b 1 -> 2, c 1 -> 2, 1 more settings"):
        built(Doubling(), built(Doubling(), out.with_name("b"), a=1, b=1, c=1, d=1).folder, a=2, b=2, c=2, d=2)


def own_stage(folder: Path, comment: str, monkeypatch: pytest.MonkeyPatch) -> Doubling:
    """A stage of a module of a user's own."""
    folder.mkdir()
    (folder / "own_stage.py").write_text(
        f"# {comment}\nfrom test_artifacts import Doubling\n\nclass Own(Doubling):\n    pass\n"
    )
    monkeypatch.delitem(sys.modules, "own_stage", raising=False)
    monkeypatch.syspath_prepend(folder)
    made: Doubling = importlib.import_module("own_stage").Own()
    return made


def test_changed_sources_are_refused_by_name(out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built(own_stage(tmp_path / "before", "as it was", monkeypatch), out)
    assert built(own_stage(tmp_path / "same", "as it was", monkeypatch), out).unchanged
    with pytest.raises(ArtifactError, match="changed: gsl itself"):
        built(own_stage(tmp_path / "after", "as it is", monkeypatch), out)


def test_another_kind_is_refused_by_name(out: Path) -> None:
    class Trebling(Doubling):
        kind: ClassVar[str] = "trebling"

    built(Doubling(), out)
    with pytest.raises(ArtifactError, match="holds doubling, not trebling"):
        built(Trebling(), out)


def test_force_replaces_only_when_the_new_one_is_complete(out: Path) -> None:
    built(Doubling(), out)
    with pytest.raises(RuntimeError):
        built(Doubling(2, ending=raising(RuntimeError())), out, force=True)
    assert (out / "sub/payload.txt").read_text() == "11"
    assert manifest.find_damage(out, manifest.read(out)) is None
    built(Doubling(2), out, force=True)
    assert (out / "sub/payload.txt").read_text() == "22"
    assert not hidden(out.parent)


def test_a_damaged_artifact_is_refused_and_force_mends_it(out: Path) -> None:
    built(Doubling(), out)
    (out / "sub/payload.txt").write_text("12")
    with pytest.raises(ArtifactError, match=r"sub/payload\.txt.*force=true"):
        built(Doubling(), out)
    built(Doubling(), out, force=True)
    assert (out / "sub/payload.txt").read_text() == "11"


def test_a_parent_counts_by_its_contents_and_not_by_its_place(out: Path, tmp_path: Path) -> None:
    first = built(Doubling(3), tmp_path / "first").folder
    second = built(Doubling(3), tmp_path / "moved" / "second", note="settings do not count").folder
    built(Doubling(data=first), out)
    again = built(Doubling(data=second), out)
    assert again.unchanged
    assert (out / again.manifest.parents[0].path).resolve() == first.resolve()
    third = built(Doubling(4), tmp_path / "third").folder
    with pytest.raises(ArtifactError, match=r"changed: the data of data\)"):
        built(Doubling(data=third), out)


def test_many_parents_of_other_contents_are_named_in_part(out: Path) -> None:
    manifest = built(Doubling(), out).manifest
    identity = Identity(manifest.kind, {}, {f"source {k:02}": "0" for k in range(45)}, manifest.sources)
    words = ", ".join(f"the data of source {k:02}" for k in range(3))
    assert changes(manifest, {}, identity, {}) == f"changed: {words} and 42 more"


def test_a_file_is_a_parent_by_its_contents(out: Path, tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a")
    made = built(Doubling(data=tmp_path / "log"), out)
    assert made.manifest.parents[0].hash == hashing.file_hash(tmp_path / "log")
    (tmp_path / "log").write_text("b")
    with pytest.raises(ArtifactError, match="the data of data"):
        built(Doubling(data=tmp_path / "log"), out)


def test_a_parent_that_is_missing_foreign_or_damaged_is_refused(out: Path, tmp_path: Path) -> None:
    parent = built(Doubling(), tmp_path / "parent").folder
    (parent / "sub/payload.txt").write_text("12")
    for data, problem in ((parent, "payload"), (tmp_path / "nothing", "not exist"), (tmp_path, "no complete artifact")):
        with pytest.raises(ArtifactError, match=problem):
            built(Doubling(data=data), out)
    assert not out.parent.exists()


@pytest.mark.parametrize("error", [RuntimeError("bug"), KeyboardInterrupt(), SystemExit(3), ArtifactError("x", "y")])
def test_a_failure_leaves_nothing(out: Path, error: BaseException) -> None:
    with pytest.raises(GslError if isinstance(error, SystemExit) else type(error)):  # the work is not done
        built(Doubling(ending=raising(error)), out)
    assert not out.parent.exists()
    assert not logging.getLogger("gsl").handlers


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES])
def test_a_full_or_read_only_folder_is_one_line(out: Path, number: int) -> None:
    with pytest.raises(GslError, match="cannot be written") as caught:
        built(Doubling(ending=raising(OSError(number, os.strerror(number)))), out)
    assert caught.value.exit_code == 1
    assert str(caught.value).startswith(str(out.parent))
    assert not out.parent.exists()


def test_a_folder_below_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(GslError, match="there can be no folder here"):
        built(Doubling(), tmp_path / "file" / "runs" / "doubling")


@pytest.mark.parametrize("force", [False, True])
def test_what_is_no_artifact_is_never_replaced(tmp_path: Path, force: bool) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    for out in (tmp_path, tmp_path / "thesis.tex"):
        with pytest.raises(ArtifactError, match="no artifact"):
            built(Doubling(), out, force=force)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_second_builder_is_told_so(out: Path) -> None:
    def ending(folder: Path) -> None:
        with pytest.raises(ArtifactError, match="another process"):
            built(Doubling(), out)

    built(Doubling(ending=ending), out)


def test_a_lock_left_by_a_dead_process_does_not_bar(out: Path) -> None:
    out.parent.mkdir(parents=True)
    (out.parent / ".doubling.lock").touch()
    (out.parent / ".doubling.tmp-1").mkdir()
    built(Doubling(), out)
    assert not hidden(out.parent)


def test_an_artifact_moved_aside_by_a_killed_process_comes_back(out: Path) -> None:
    built(Doubling(), out)
    out.rename(out.with_name(".doubling.replaced"))
    assert built(Doubling(), out).unchanged
    assert not hidden(out.parent)


def test_resumable_work_finds_what_it_left(out: Path) -> None:
    def ending(folder: Path) -> None:
        (folder / "progress").write_text("half")
        raise KeyboardInterrupt

    def resuming(folder: Path) -> None:
        assert (folder / "progress").read_text() == "half"

    with pytest.raises(KeyboardInterrupt):
        built(Resumable(ending=ending), out)
    assert hidden(out.parent) == [".doubling.partial"]
    made = built(Resumable(ending=resuming), out)
    assert "progress" in made.manifest.files
    assert ".key" not in {path.name for path in out.iterdir()}
    assert (out / "log.txt").read_text().count("begins") == 2
    assert not hidden(out.parent)


def test_resumable_work_that_fails_before_it_has_begun_leaves_nothing(out: Path) -> None:
    with pytest.raises(GslError):
        built(Resumable(ending=raising(GslError("refused"))), out)
    assert not out.parent.exists()


def test_a_partial_of_other_work_is_discarded(out: Path) -> None:
    def ending(folder: Path) -> None:
        (folder / "progress").write_text("1")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        built(Resumable(1, ending=ending), out)
    assert hidden(out.parent) == [".doubling.partial"]
    assert "progress" not in built(Resumable(2), out).manifest.files


KILLED = """
import signal, sys, time
from pathlib import Path
from gsl.storage.artifact import build
signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background is deaf to it
class Slow:
    kind, progress = "slow", "half" if sys.argv[2] == "resumable" else ""
    def parents(self): return {}
    def run(self, folder, console):
        (folder / "half").write_text("half")
        print("ready", flush=True)
        time.sleep(60)
build(Slow(), config={}, out=Path(sys.argv[1]), command="", force=False, console=None)
"""


@pytest.mark.parametrize(
    ("number", "mode", "left"),
    [
        (signal.SIGTERM, "plain", []),
        (signal.SIGINT, "plain", []),
        (signal.SIGTERM, "resumable", [".doubling.partial"]),
        (signal.SIGKILL, "resumable", [".doubling.lock", ".doubling.partial"]),
    ],
)
def test_a_signal_leaves_no_half_artifact(out: Path, number: int, mode: str, left: list[str]) -> None:
    command = [sys.executable, "-c", KILLED, str(out), mode]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(ArtifactError, match="another process"):
            built(Doubling(), out)
        process.send_signal(number)
        assert process.wait(20) != 0
    assert sorted(path.name for path in out.parent.glob("*")) == left
    out.parent.mkdir(parents=True, exist_ok=True)
    with (out.parent / "probe").open("w") as probe:
        fcntl.flock(probe, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_the_hash_of_the_sources_is_cheap() -> None:
    begin = time.process_time()
    hashing.sources_hash(hashing.PACKAGE)  # as another package: read once more
    assert time.process_time() - begin < 0.1


def test_a_manifest_of_another_version_or_damaged_is_refused(out: Path) -> None:
    built(Doubling(), out)
    stored = json.loads((out / "manifest.json").read_text())
    for contents in ("{", "[]", json.dumps({**stored, "schema_version": 3}), json.dumps({"schema_version": 2})):
        (out / "manifest.json").write_text(contents)
        with pytest.raises(ArtifactError):
            manifest.read(out)


def test_a_json_file_has_numbers_of_a_list_on_one_line_and_is_read_as_it_was(tmp_path: Path) -> None:
    value = {
        "a": [[1, -2.5e-07, None], [], ["1,\n2", 3]],
        "b": [{"c": [1.0]}],
        "d": "[\n 1,\n 2\n] [ 1, 2 ] [\u2028 3 \u2028]",
    }
    write_json(tmp_path / "a.json", value)
    written = (tmp_path / "a.json").read_text(encoding="utf-8")
    assert json.loads(written) == value
    lines = [line.strip() for line in written.splitlines()]
    assert "[1, -2.5e-07, null]," in lines
    assert '"c": [1.0]' in lines


def test_a_parent_that_is_exchanged_while_a_stage_works_is_refused(out: Path, tmp_path: Path) -> None:
    log, parent = tmp_path / "log", built(Doubling(), tmp_path / "parent").folder
    log.write_text("a")

    def damaging(folder: Path) -> None:
        (parent / "sub/payload.txt").write_text("12")

    for data, ending in (
        (log, lambda folder: log.write_text("b")),
        (log, lambda folder: log.unlink()),
        (parent, damaging),
    ):
        with pytest.raises(GslError, match=f"data .*{data}.* was changed while doubling was at work") as caught:
            built(Doubling(data=data, ending=ending), out)
        assert caught.value.exit_code == 1
        assert not out.parent.exists()


@pytest.mark.parametrize("linked", ["progress", "log.txt", "metrics.jsonl", ".key", "sub", ""])
def test_work_that_a_stranger_left_writes_through_no_link(linked: str, out: Path, tmp_path: Path) -> None:
    def dying(folder: Path) -> None:
        (folder / "progress").write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        built(Resumable(ending=dying), out)
    partial, mine = out.with_name(f".{out.name}.partial"), tmp_path / "mine"
    place = partial / linked if linked else partial
    if linked in ("sub", ""):
        if place.exists():
            place.rename(mine)
        mine.mkdir(exist_ok=True)
    else:
        mine.write_text("my own diary" if linked != ".key" else place.read_text())
        place.unlink(missing_ok=True)
    place.symlink_to(mine)
    before = {path: path.read_text() for path in (mine, *mine.rglob("*")) if path.is_file()}
    made = built(Resumable(), out)
    assert {path: path.read_text() for path in (mine, *mine.rglob("*")) if path.is_file()} == before
    assert not any(path.is_symlink() for path in out.rglob("*")) and not out.is_symlink()
    assert "progress" not in made.manifest.files or (out / "progress").read_text() != "my own diary"


def test_what_a_kill_left_beside_the_progress_is_no_part_of_the_artifact(out: Path) -> None:
    """Half a payload, the temporary name of another one, a file of a stage that would write it only sometimes."""

    def dying(folder: Path) -> None:
        (folder / "progress").write_text("half")
        (folder / ".progress.tmp-1").write_text("ha")
        (folder / "sub/.payload.txt.tmp-77").write_text("1")
        (folder / "grounding.json").write_text("{}")
        raise KeyboardInterrupt

    def with_dead_worker(folder: Path) -> None:
        (folder / "sub/.payload.txt.tmp-78").write_text("1")

    with pytest.raises(KeyboardInterrupt):
        built(Resumable(ending=dying), out)
    made = built(Resumable(ending=with_dead_worker), out)
    assert set(made.manifest.files) == {"config.yaml", "log.txt", "metrics.json", "progress", "sub/payload.txt"}
    assert {path.name for path in out.rglob("*.tmp-*")} == set()


def test_a_kill_in_the_middle_of_the_renaming_loses_neither_the_old_nor_the_new(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ending(folder: Path) -> None:
        (folder / "progress").write_text("whole")

    flush = os.fsync

    def dying(*_: Any, **__: Any) -> int:
        raise SystemExit  # as far as the folders go, the end of the process

    def dying_at_last(descriptor: int) -> None:
        return dying() if complete(out) else flush(descriptor)

    for library, call, how in ((ctypes, "CDLL", dying), (os, "fsync", dying_at_last)):
        built(Resumable(1, ending=ending), out, force=True)
        with monkeypatch.context() as patch:
            patch.setattr(library, call, how)
            with pytest.raises(SystemExit):
                built(Resumable(2, ending=ending), out, force=True)
        assert (out / "sub/payload.txt").read_text() == "11"
        stage = Resumable(2)
        built(stage, out, force=True)
        assert not stage.calls, "the complete work is taken over"
        assert (out / "sub/payload.txt").read_text() == "22"
        assert not hidden(out.parent)
        assert built(Resumable(2), out).unchanged


@pytest.mark.parametrize("swap", [True, False], ids=["exchange", "two renames"])
def test_the_key_is_in_no_complete_artifact_and_the_old_one_goes(
    out: Path, swap: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not swap:
        monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace())  # a system without renameat2
    for number in (1, 2):
        built(Doubling(number), out, force=True)
        assert (out / "sub/payload.txt").read_text() == 2 * str(number)
        assert not hidden(out)
        assert not hidden(out.parent)


@pytest.mark.parametrize("name", ["*", "[ab]", "a?", "a.tmp-1"])
def test_an_odd_name_touches_nobody_elses_work(tmp_path: Path, name: str) -> None:
    others = [tmp_path / ".a.tmp-1", tmp_path / ".ab.tmp-12", tmp_path / ".a.tmp-1.tmp-12x"]
    for other in others:
        other.mkdir()
    built(Doubling(), tmp_path / name)
    assert all(other.is_dir() for other in others)
    built(Doubling(), tmp_path / "a")
    assert [other.is_dir() for other in others] == [False, True, True]


@pytest.mark.parametrize("place", [".", "/", "..", "a/.."])
def test_a_place_without_a_name_is_refused(place: str) -> None:
    with pytest.raises(ArtifactError, match="out="):
        built(Doubling(), Path(place))


def test_every_flipped_bit_of_a_manifest_is_seen_and_force_mends_it(out: Path) -> None:
    built(Doubling(), out)
    path = out / "manifest.json"
    whole, same = path.read_bytes(), manifest.read(out)
    for index in range(0, len(whole)):
        flipped = bytearray(whole)
        flipped[index] ^= 1 << index % 8
        path.write_bytes(flipped)
        try:
            assert manifest.read(out) == same
        except ArtifactError:
            continue
    with pytest.raises(ArtifactError, match=r"manifest\.json: is damaged.*force=true"):
        built(Doubling(), out)
    built(Doubling(), out, force=True)
    assert manifest.find_damage(out, manifest.read(out)) is None


def test_a_manifest_without_files_hides_no_damage(out: Path) -> None:
    built(Doubling(), out)
    path = out / "manifest.json"
    whole = json.loads(path.read_text())
    older = {key: value for key, value in whole.items() if key not in ("sha256", "links")} | {"schema_version": 1}
    path.write_text(json.dumps(older))
    assert manifest.read(out).files == manifest.read(out).files
    for stored in (whole, older):
        path.write_text(json.dumps({**stored, "files": {}}))
        with pytest.raises(ArtifactError, match="is damaged"):
            manifest.read(out)
    path.write_text(json.dumps({key: value for key, value in whole.items() if key != "sha256"}))
    with pytest.raises(ArtifactError, match="is damaged"):
        manifest.read(out)


def test_a_refusal_of_the_system_is_said_as_what_it_is(out: Path, tmp_path: Path) -> None:
    """Only what concerns the folder that is being written is called so."""
    for error in (
        OSError(errno.EIO, os.strerror(errno.EIO), str(tmp_path / "log.csv")),
        PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(out.parent / "collect" / "a.parquet")),
        OSError(errno.EMFILE, os.strerror(errno.EMFILE)),
    ):
        with pytest.raises(OSError) as caught:
            built(Doubling(ending=raising(error)), out)
        assert caught.value is error
        message, code = describe_failure(error)
        assert str(error.strerror) in message
        assert "internal" not in message
        assert code == 1


def test_a_full_disk_ends_the_log_without_a_traceback(out: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def ending(folder: Path) -> None:
        handler = logging.getLogger("gsl").handlers[-1]
        assert isinstance(handler, logging.FileHandler)
        handler.setStream(Path("/dev/full").open("w"))  # noqa: SIM115  the handler closes it
        logging.getLogger("gsl").info("one line more")

    with pytest.raises(GslError, match="cannot be written: No space left"):
        built(Doubling(ending=ending), out)
    assert capfd.readouterr().err == ""


@dataclass
class Chaining(Doubling):
    """A stage that builds two others beside itself."""

    kind: ClassVar[str] = "chaining"
    makes: ClassVar[tuple[str, ...]] = ("grounding",)

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        first = built(Doubling(1), folder.parent / "first", force=True).folder
        built(Doubling(2, data=first), folder.parent / "second", force=True)
        return super().run(folder, console)


def test_what_was_made_from_a_file_of_an_artifact_is_out_of_date_with_it(tmp_path: Path) -> None:
    """A log is named by its file, and a file beside an artifact is nobody's."""
    first = built(Doubling(1), tmp_path / "first").folder
    second = built(Doubling(2, data=first / "sub/payload.txt"), tmp_path / "second").folder
    (tmp_path / "mine.txt").write_text("1")
    third = built(Doubling(2, data=tmp_path / "mine.txt"), tmp_path / "third").folder
    assert (out_of_date(second), out_of_date(third)) == (None, None)
    built(Doubling(3), first, force=True)
    (tmp_path / "mine.txt").write_text("2")
    assert out_of_date(third) is None
    assert (said := out_of_date(second)) and said.endswith(
        f"first was built anew since {second.as_posix()} was made from it"
    )


LINKS: dict[str, tuple[Callable[[Path], object], str]] = {
    "deleted": (lambda home: shutil.rmtree(home / "first"), "gone or damaged: .*first"),
    "damaged": (lambda home: (home / "second/sub/payload.txt").write_text("12"), "changed since: .*second/sub/payload"),
    "without manifest": (lambda home: (home / "second/manifest.json").unlink(), "gone or damaged: .*second"),
    "built anew": (lambda home: built(Doubling(3), home / "first", force=True), "built anew since: .*first"),
}


@pytest.mark.parametrize("how", LINKS)
def test_a_chain_is_unchanged_only_with_its_links(out: Path, how: str) -> None:
    act, words = LINKS[how]
    home = out.parent
    made = built(Chaining(), out)
    assert [(link.role, link.path) for link in made.manifest.links] == [
        ("doubling", "../first"),
        ("doubling", "../second"),
    ]
    assert built(Chaining(), out).unchanged
    act(home)
    if how == "without manifest":
        shutil.rmtree(home / "second")  # what is no artifact is not built over
    with pytest.raises(ArtifactError, match=words):
        built(Chaining(), out)
    assert not built(Chaining(), out, force=True).unchanged
    assert built(Chaining(), out).unchanged


def test_a_moved_chain_is_unchanged_whatever_its_parts_would_be_called(out: Path) -> None:
    names = {"_target_": "Gat", "forward_model": "quick/train_forward", "inner": {"servo": "quick/train_servo"}}
    built(Chaining(), out, grounding=names)
    moved = out.parent.rename(out.parent.with_name("moved")) / out.name
    names = {"_target_": "Gat", "forward_model": "moved/train_forward", "inner": {"servo": "moved/train_servo"}}
    assert built(Chaining(), moved, grounding=names).unchanged
    with pytest.raises(ArtifactError, match="world.servo a -> b"):
        built(Chaining(), moved.with_name("b"), world={"servo": "a"})
        built(Chaining(), moved.with_name("b"), world={"servo": "b"})
