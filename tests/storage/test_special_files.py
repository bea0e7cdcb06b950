"""What is no plain file is refused before it is opened: a pipe, a device, a file that the kernel makes up."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from commands import ENVIRONMENT, SMALL, done, refused

from gsl.core.budget import check_file, holds, open_file
from gsl.errors import GslError, InputError
from gsl.runner.robots import robot_of
from gsl.storage.importers.formats import ENDS, table
from gsl.storage.records import Records

pytestmark = pytest.mark.skipif(not Path("/proc/version").exists(), reason="such files are Linux's")

SECONDS = 10  # in which a command is refused on a busy machine; one that has opened such a file waits forever
KINDS = {"pipe": "", "device": "/dev/zero", "kernel": "/proc/kmsg"}
NO_FILE = "is no plain file"


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)


def put(path: Path, kind: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    os.symlink(KINDS[kind], path) if KINDS[kind] else os.mkfifo(path)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_opens_files_refuses_it(kind: str, tmp_path: Path) -> None:
    path = put(tmp_path / "x.py", kind)
    assert not holds(path, b"")
    for read in (check_file, open_file, lambda path: Records(path, print)):
        with pytest.raises(InputError, match=NO_FILE):
            read(path)
    with pytest.raises(GslError, match=f"{NO_FILE}|does not exist"):
        robot_of(path)


@pytest.mark.parametrize("mount", ("--bind /proc", "-t proc proc", "-t sysfs sysfs", "--bind /proc/version"))
def test_the_kernels_files_under_another_name(mount: str, tmp_path: Path) -> None:
    place = tmp_path / "x"
    place.touch() if mount.endswith("version") else place.mkdir()
    file = place if place.is_file() else place / ("power/state" if "sysfs" in mount else "version")
    line = ["unshare", "--map-root-user", "--mount", "--pid", "--net", "--fork", "sh", "-c"]
    mounted = f"mount {mount} {place} && "
    if not shutil.which("unshare") or subprocess.run([*line, f"{mounted} true"], check=False).returncode:
        pytest.skip("nothing can be mounted here")
    ask = f"from gsl.core.budget import check_file; from pathlib import Path; check_file(Path({str(file)!r}))"
    line += [f'{mounted} exec "$0" -c "$1"', sys.executable, ask]
    ended = subprocess.run(line, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert f"InputError: {file}: {NO_FILE}" in ended.stderr


def test_what_was_checked_is_what_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, check = tmp_path / "x.csv", os.path.realpath
    path.write_text("good")

    def exchange(name: Path) -> str:  # after the last look at the path
        monkeypatch.undo()
        path.unlink()
        os.mkfifo(path)
        return check(name)

    monkeypatch.setattr(os.path, "realpath", exchange)
    with pytest.raises(InputError, match=NO_FILE):
        open_file(path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_of_any_format(kind: str, tmp_path: Path) -> None:
    for end in ENDS:
        path = put(tmp_path / f"log{end}", kind)
        with pytest.raises(InputError, match=NO_FILE):
            table(path, topic="", records="", memory=1e9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_a_setting_names(kind: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time,action.a,position.a\n0,0,0\n")
    put(tmp_path / "mine/world/w.yaml", kind)
    for name in ("m.yaml", "r.urdf", "d.parquet", "log.mcap"):
        put(tmp_path / name, kind)
    for words in (
        ("import", "source=log.mcap", "mapping=plain"),
        ("import", "source=log.csv", "mapping=m.yaml"),
        ("collect", "--config-dir", "mine", "world=w"),
        ("collect", "role=real", "world.robot=r.urdf", *SMALL),
        ("train-forward", "data=d.parquet"),
    ):
        said = refused(*words, folder=tmp_path)
        assert NO_FILE in said or "there is no such" in said or "no world called w" in said


def test_a_file_that_another_process_would_have_left(tmp_path: Path) -> None:
    put(tmp_path / "runs/k/.export.partial/.key", "kernel")
    done("export", "world=nao_ideal", "format=mjcf", "name=k", folder=tmp_path)
