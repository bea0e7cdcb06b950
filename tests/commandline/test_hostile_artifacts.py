"""Artifacts, logs and settings of strangers whose hashes are right: nothing in them is believed without a look."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import ENVIRONMENT, SMALL, done, gsl, refused
from strangers import seal

from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import ArtifactError
from gsl.storage import manifest
from gsl.storage.hashing import file_hash
from gsl.storage.lineage import COPY, LONGEST, REPEAT
from gsl.storage.trajectories import write

pytestmark = pytest.mark.slow

LOG = "time,action.a,position.a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k},{0.1 * k}\n" for k in range(50))
NO_TEXT = os.fsdecode(b"a\xff")
MARK = "from pathlib import Path\nPath('ran').write_text('yes')\n\n\ndef arm():\n    pass\n"


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log that was imported, and a module that leaves a mark when it is imported."""
    folder = tmp_path_factory.mktemp("imported")
    (folder / "log.csv").write_text(LOG)
    (folder / "evil.py").write_text(MARK)
    done("import", "source=log.csv", "mapping=plain", "name=a", folder=folder)
    return folder


@pytest.fixture
def artifact(imported: Path, tmp_path: Path) -> Path:
    """The imported log as runs/a/import, in a copy of its folder."""
    shutil.copytree(imported, tmp_path, dirs_exist_ok=True)
    return tmp_path / "runs/a/import"


def test_a_film_of_a_log_imports_no_robot_that_only_the_log_names(artifact: Path, tmp_path: Path) -> None:
    moments = np.arange(20) * 0.01
    still = np.zeros((20, 1))
    episode = Trajectory(time=moments, action=still[1:], position=still, velocity=still)
    write(artifact / "trajectories.parquet", Batch((episode,), ("a",), 0.01, {"robot": "evil.arm", "role": "real"}))
    seal(artifact)
    said = gsl("render", "a", "out=film.gif", folder=tmp_path)
    assert (said.code, "say trust=evil if" in said.err) == (2, True), said
    assert not (tmp_path / "ran").exists()


def test_a_lineage_does_not_steer_the_terminal(artifact: Path, tmp_path: Path) -> None:
    parent = {"role": "\x1b[2J\n", "path": "\u202egone", "hash": "\x9b1m"}
    seal(artifact, kind="\x1b]0;owned\x07", parents=[parent])
    said = gsl("lineage", "a", folder=tmp_path)
    assert not any(steering in said.out + said.err for steering in "\x1b\x07\x9b\u202e"), said
    assert "\\u001b]0;owned\\u0007" in said.out
    assert len(said.out.splitlines()) == 2


def test_a_lineage_without_end_is_no_damage(artifact: Path, tmp_path: Path) -> None:
    contents = manifest.read(artifact).contents
    for k in range(LONGEST + 20):
        folder, above = tmp_path / f"runs/{k:03d}/import", "a" if k == 0 else f"{k - 1:03d}"
        shutil.copytree(artifact, folder)
        seal(folder, parents=2 * [{"role": "source", "path": f"../../{above}/import", "hash": contents}])
    seal(artifact, parents=[{"role": "source", "path": "../../010/import", "hash": contents}])  # round and round
    last = f"{LONGEST + 19:03d}"
    for command in ("verify", "lineage"):
        said = gsl(command, last, folder=tmp_path)
        assert said.code == 1, said
        assert f"runs/019/import: is {LONGEST} generations back; what it" in said.lines[-1]
    assert "all files are as they were made\n" in done("show", last, folder=tmp_path).out
    assert "nothing below runs/ could go" in done("clean", "stale=true", folder=tmp_path).out
    (tmp_path / "runs/000/import/log.txt").write_text("another")
    assert "runs/000/import: log.txt is not as" in gsl("verify", "005", folder=tmp_path).err


def test_a_mapping_may_be_a_link_to_a_file_of_any_name(artifact: Path, tmp_path: Path) -> None:
    (tmp_path / "version_2").write_text("defaults: [plain]\n")
    (tmp_path / "mine.yaml").symlink_to("version_2")
    done("import", "source=log.csv", "mapping=mine.yaml", "check=true", folder=tmp_path)


SAID = {"force": "true", "out": "../elsewhere", "executor": "dask", "address": "tcp://127.0.0.1:1"}


@pytest.mark.parametrize("key", SAID)
def test_a_file_neither_replaces_artifacts_nor_writes_or_sends_elsewhere(key: str, tmp_path: Path) -> None:
    place = tmp_path / "theirs/experiment/theirs.yaml"
    place.parent.mkdir(parents=True)
    place.write_text(f"# @package _global_\n{key}: {SAID[key]}\n")
    said = gsl("collect", "--config-dir=theirs", "experiment=theirs", "--cfg", "job", folder=tmp_path)
    assert (said.code, f"type {key}=..." in said.err) == (2, True), said
    typed = {"address": ("executor=dask", f"{key}={SAID[key]}")}.get(key, (f"{key}={SAID[key]}",))
    done("collect", *typed, "--cfg", "job", folder=tmp_path)


@pytest.mark.parametrize("launcher", ["basic", "joblib"])
def test_no_job_of_a_multirun_lets_its_files_send_elsewhere(launcher: str, tmp_path: Path) -> None:
    if launcher == "joblib":
        pytest.importorskip("hydra_plugins.hydra_joblib_launcher")
    place = tmp_path / "theirs/task"
    place.mkdir(parents=True)
    (place / "first.yaml").write_text("defaults: [walk]\n")
    said = "executor: dask\naddress: tcp://127.0.0.1:1\ntask:\n  _target_: gsl.tasks.walk.Walk\n"
    (place / "second.yaml").write_text(f"# @package _global_\n{said}")
    words = ["collect", "--multirun", "--config-dir=theirs", "task=first,second", *SMALL, f"hydra/launcher={launcher}"]
    if launcher == "joblib":  # in this process: workers of an earlier test stand in another folder
        words.append("hydra.launcher.n_jobs=1")
    ended = gsl(*words, "name=a", folder=tmp_path)
    assert ended.code == 2, ended
    assert "executor = dask: is said by a file, and only you can say it" in ended.err + ended.out
    assert [path.parent.name for path in (tmp_path / "runs/a").glob("*/collect_real")] == ["task=first"]


def test_a_file_of_very_many_settings_is_refused(tmp_path: Path) -> None:
    place = tmp_path / "theirs/experiment/theirs.yaml"
    place.parent.mkdir(parents=True)
    place.write_text("# @package _global_\n" + "".join(f"a{k}: {k}\n" for k in range(11_000)))
    said = refused("collect", "--config-dir=theirs", "experiment=theirs", folder=tmp_path)
    assert "holds 22,001 entries" in said


@pytest.mark.parametrize("names", [["theirs"], ["e{}@a", "e{}@b"]], ids=["itself", "twice the next"])
def test_files_that_name_each_other_without_end_are_given_up(names: list[str], tmp_path: Path) -> None:
    place = tmp_path / "theirs/experiment"
    place.mkdir(parents=True)
    for k in range(40):
        words = ", ".join(name.format(k + 1) for name in names)
        (place / ("theirs.yaml" if k == 0 else f"e{k}.yaml")).write_text(f"defaults: [{words}]\n")
    begin = time.process_time()
    said = gsl("collect", "--config-dir=theirs", "experiment=theirs", "--cfg", "job", folder=tmp_path)
    assert (said.code, len(said.lines)) == (2, 1), said
    assert time.process_time() - begin < 30.0


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("defaults: [/collect]\n", "yaml files name each other in a circle, in their `defaults:`"),
        ("name: ${oc.env:HOME\n", "collect.yaml: holds a reference that cannot be read; it is written as ${sim.robot}"),
    ],
)
def test_a_file_that_hydra_says_nothing_of_is_told_in_words(text: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs/collect.yaml").write_text(text)
    assert refused("collect", "--config-dir=theirs", "--cfg", "job", folder=tmp_path).endswith(problem)


def test_a_file_does_not_refer_to_another_place_either(tmp_path: Path) -> None:
    place = tmp_path / "theirs/experiment/theirs.yaml"
    place.parent.mkdir(parents=True)
    place.write_text("# @package _global_\nout: ${task.elsewhere}\ntask: {elsewhere: /tmp}\n")
    said = gsl("collect", "--config-dir=theirs", "experiment=theirs", "--cfg", "job", folder=tmp_path)
    assert said.code == 2, said


ENTRIES: dict[str, Any] = {
    "kind": {"a": 1}, "key": [], "command": 5, "created": None, "duration": 10**290, "versions": [], "seeds": 3,
    "git": "x", "unit": [1], "sources": {}, "trust": [1], "parents": [{"role": 1, "path": "x", "hash": "y"}],
    "links": [{"role": "x", "path": "a\0b", "hash": "y"}],
}  # fmt: skip


@pytest.mark.parametrize("name", ENTRIES)
def test_a_manifest_whose_entries_are_of_another_kind_is_damaged(name: str, artifact: Path, tmp_path: Path) -> None:
    seal(artifact, **{name: ENTRIES[name]})
    with pytest.raises(ArtifactError, match="is damaged"):
        manifest.read(artifact)
    assert gsl("runs", folder=tmp_path).code == 0


def test_metrics_that_no_number_fits_do_not_stop_the_list(artifact: Path, tmp_path: Path) -> None:
    (artifact / "metrics.json").write_text(f'{{"seconds": {"9" * 400}, "episodes": {"9" * 299}}}')
    seal(artifact)
    for words in (("runs",), ("runs", "metric=seconds"), ("show", "a")):
        assert "internal error" not in gsl(*words, folder=tmp_path).err


def test_a_parent_of_terabytes_is_not_hashed(artifact: Path, tmp_path: Path) -> None:
    with (tmp_path / "sparse").open("wb") as file:
        file.truncate(2**40)
    seal(artifact, parents=[{"role": "source", "path": "../../../sparse", "hash": "0" * 64}])
    for words in (("verify", "a"), ("lineage", "a"), ("show", "a"), ("rerun", "a")):
        said = gsl(*words, folder=tmp_path)
        assert "internal error" not in said.err and said.code in (0, 1, 2)


def test_every_wrong_parent_of_a_forged_manifest_comes_with_what_to_do(artifact: Path, tmp_path: Path) -> None:
    plain = "is no plain file; copy what it holds into one"
    paths = ("/proc/version", "/etc/passwd", "../../../elsewhere")
    seal(artifact, parents=[{"role": path, "path": path, "hash": "0" * 64} for path in paths])
    said = gsl("verify", "a", folder=tmp_path)
    assert (said.code, len(said.lines)) == (1, len(paths))
    for line in said.lines:
        assert any(remedy in line for remedy in (plain, REPEAT, COPY)), line
    assert plain in gsl("rerun", "a", folder=tmp_path).err


@pytest.mark.parametrize("kind", ["a pipe", "a device", "gigabytes", "deep"])
def test_a_manifest_that_cannot_be_read_does_not_stop_the_list(kind: str, artifact: Path, tmp_path: Path) -> None:
    done("import", "source=log.csv", "mapping=plain", "name=b", folder=tmp_path)
    path = artifact / manifest.NAME
    path.unlink()
    match kind:
        case "a pipe":
            os.mkfifo(path)
        case "a device":
            path.symlink_to("/dev/zero")
        case "gigabytes":
            with path.open("wb") as file:
                file.truncate(2**40)
        case _:
            path.write_text("[" * 10_000)
    assert "runs/b" in gsl("runs", "--json", folder=tmp_path).out
    assert gsl("verify", folder=tmp_path).code == 1
    assert gsl("show", "a", folder=tmp_path).code == 2


def test_cleaning_removes_no_file_of_another_artifact(artifact: Path, tmp_path: Path) -> None:
    done("import", "source=log.csv", "mapping=plain", "name=b", folder=tmp_path)
    log = artifact / "trajectories.parquet"
    theirs = tmp_path / "runs/b/import"
    (theirs / "beside").symlink_to(artifact)
    stored = json.loads((theirs / manifest.NAME).read_text())
    parents = [{"role": "source", "path": "../gone", "hash": "0" * 64}]
    seal(theirs, parents=parents)
    files = {**stored["files"], "beside/trajectories.parquet": {"sha256": file_hash(log), "bytes": log.stat().st_size}}
    seal(theirs, parents=parents, files=files)
    done("clean", "orphaned=true", "--yes", "name=b", folder=tmp_path)
    assert log.exists() and not (theirs / "trajectories.parquet").exists()


STREAMS = {
    "stdout is closed": ">&-", "stderr is closed": "2>&-", "stdin is closed": "<&-", "the disk is full": "> /dev/full",
}  # fmt: skip


@pytest.mark.parametrize("how", STREAMS)
def test_a_stream_that_is_gone_is_no_traceback(how: str, tmp_path: Path) -> None:
    said = _in_shell(f'"$0" -m gsl runs {STREAMS[how]}', tmp_path)
    assert "Traceback" not in said.stderr and "internal error" not in said.stderr, said
    assert "Exception ignored" not in said.stderr
    assert said.returncode == (1 if "full" in how else 0)


def test_a_folder_that_is_gone_is_one_line(tmp_path: Path) -> None:
    said = _in_shell('mkdir x && cd x && rmdir ../x && "$0" -m gsl runs', tmp_path)
    assert (said.returncode, said.stderr.count("\n")) == (2, 1), said
    assert "the current folder is gone" in said.stderr


def test_what_a_terminal_cannot_show_is_spelled_out(tmp_path: Path) -> None:
    said = _in_shell('PYTHONIOENCODING=ascii "$0" -m gsl show π0', tmp_path)
    assert said.returncode == 2 and "\\u03c00" in said.stderr, said


def _in_shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**ENVIRONMENT, "PYTHONPATH": str(Path(__file__).parents[2])}
    words = ["sh", "-c", line, sys.executable]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False)


def test_a_word_that_is_no_text_is_one_line(tmp_path: Path) -> None:
    assert "is no text in UTF-8" in gsl("collect", f"name={NO_TEXT}", folder=tmp_path).err


def test_a_name_with_line_ends_makes_no_second_line(tmp_path: Path) -> None:
    said = gsl("show", "a\nwarning: all is well\u202e\u061c", folder=tmp_path)
    assert len(said.lines) == 1 and "\u202e" not in said.err and "\u061c" not in said.err


@pytest.mark.parametrize("word", ["name=.multirun", "name=a/.collect_real.tmp-1", "out=runs/x/.collect_real.partial"])
def test_an_artifact_does_not_hide_among_what_is_cleaned_away(word: str, artifact: Path, tmp_path: Path) -> None:
    said = gsl("import", "source=log.csv", "mapping=plain", word, folder=tmp_path)
    assert said.code == 2 and ("hidden" in said.err), said


SAYING = "import sys\nfrom gsl.runner.saying import say\nsay('π0 walks')\nsay('and stands')\n"


@pytest.mark.parametrize("how", [">&-", "> /dev/full", "| true", "> out"])
def test_a_runner_whose_terminal_is_gone_goes_on(how: str, tmp_path: Path) -> None:
    said = _in_shell(f'sleep 0.1; PYTHONIOENCODING=ascii "$0" -c "{SAYING}" {how}; echo $? >&2', tmp_path)
    assert said.stderr == "0\n"


PAGE = """
import sys
from pathlib import Path

from gsl.commandline.elsewhere import import_elsewhere
from gsl.report.style import figure, look, save

if sys.argv[1] == "elsewhere":
    import_elsewhere()
with look():
    drawn = figure(2.0, 3.0)
    drawn.add_subplot().set_title("title")
save(drawn, Path(sys.argv[2]))
"""


def test_a_file_of_the_current_folder_does_not_steer_figures(tmp_path: Path) -> None:
    environment = {**ENVIRONMENT, "PYTHONPATH": str(Path(__file__).parents[2])}
    pictures = []
    for name, settings in {"plain": None, "theirs": b"text.usetex: True\nfont.size: 30\nba\x1b[2Jd: \xff\n"}.items():
        if settings:
            (tmp_path / "matplotlibrc").write_bytes(settings)
        words = [sys.executable, "-c", PAGE, "elsewhere", f"{name}.png"]
        said = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert (said.returncode, said.stderr) == (0, "")
        pictures.append((tmp_path / f"{name}.png").read_bytes())
    assert pictures[0] == pictures[1]
