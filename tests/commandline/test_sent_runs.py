"""A run that somebody has sent: as a folder of settings, without what it was made from, changed on the way."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import pytest
from commands import done, gsl, refused
from strangers import seal

import gsl as library
from gsl.errors import InputError
from gsl.storage import manifest

pytestmark = pytest.mark.slow

LOG = "time,action.a,position.a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k},{0.1 * k}\n" for k in range(50))
AGAIN = "copy the run again, or build it anew with force=true"
WORLD = "world/mine.yaml"


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log that was imported."""
    place = tmp_path_factory.mktemp("imported")
    (place / "log.csv").write_text(LOG)
    done("import", "source=log.csv", "mapping=plain", "name=a", folder=place)
    return place


@pytest.fixture
def run(imported: Path, tmp_path: Path) -> Path:
    """The imported log as runs/a/import, with a page and a world, as a diagnosis has them."""
    shutil.copytree(imported, tmp_path, dirs_exist_ok=True)
    folder = tmp_path / "runs/a/import"
    (folder / "world").mkdir()
    for name, text in ((WORLD, "defaults: [nao_ideal, _self_]\nstep: 0.001\n"), ("report.html", "<p>\n")):
        (folder / name).write_text(text)
    seal(folder, more=(WORLD, "report.html"))
    return folder


def composed(folder: Path) -> str:
    words = ("world=mine", "--cfg", "job", "--json")
    return json.loads(done("collect", "--config-dir=runs/a/import", *words, folder=folder).out)["world"]["step"]


def test_a_run_is_a_folder_of_settings_as_long_as_these_are_as_they_were_written(run: Path, tmp_path: Path) -> None:
    assert composed(tmp_path) == 0.001
    (run / "log.txt").write_text("another")  # no setting
    (run / "mine.txt").write_text("beside")
    assert composed(tmp_path) == 0.001


@pytest.mark.parametrize("name", ["config.yaml", WORLD])
@pytest.mark.parametrize("option", ["--cfg=job", "--help"])
def test_changed_settings_of_a_run_are_none(name: str, option: str, run: Path, tmp_path: Path) -> None:
    (run / name).write_text((run / name).read_text() + "seed: 7\n")
    said = gsl("collect", "--config-dir=runs/a/import", "world=mine", option, folder=tmp_path)
    assert (said.code, said.out, len(said.lines)) == (2, "", 1)
    assert f"--config-dir runs/a/import/{name}: is not as the manifest says; {AGAIN}; or copy what you" in said.err
    with pytest.raises(InputError, match=f"{name}: is not as the manifest says"):
        library.make_world("mine", config_dir=run)


def test_settings_that_were_laid_into_a_run_are_none(run: Path, tmp_path: Path) -> None:
    (run / "world/nao_ideal.yaml").write_text("step: 0.0001\n")  # would win over ours
    line = refused("collect", "--config-dir=runs/a/import", "world=mine", "--cfg", "job", folder=tmp_path)
    assert "world/nao_ideal.yaml: is no file of the artifact; take it out of the folder" in line
    (run / "manifest.json").write_text("{")
    line = refused("collect", "--config-dir=runs/a/import", "--cfg", "job", folder=tmp_path)
    assert line.startswith(f"--config-dir runs/a/import/manifest.json: is damaged: it is not JSON; {AGAIN}")


def test_a_folder_of_ones_own_may_hold_a_manifest_of_something_else(tmp_path: Path) -> None:
    (tmp_path / "mine/world").mkdir(parents=True)
    (tmp_path / "mine/manifest.json").write_text('{"name": "my page"}')
    (tmp_path / "mine/world/mine.yaml").write_text("defaults: [nao_ideal, _self_]\n")
    done("collect", "--config-dir=mine", "world=mine", "--cfg", "job", folder=tmp_path)


def test_a_page_that_was_changed_is_not_opened(run: Path, tmp_path: Path) -> None:
    assert done("open", "a", folder=tmp_path).out == "runs/a/import/report.html\n"
    (run / "report.html").write_text("<script>")
    assert refused("open", "a", folder=tmp_path) == f"runs/a/import/report.html: is not as the manifest says; {AGAIN}"
    (run / "report.html").unlink()
    assert refused("open", "a", folder=tmp_path) == f"runs/a/import/report.html: is missing; {AGAIN}"


def test_a_page_that_was_laid_into_a_run_is_not_opened(imported: Path, tmp_path: Path) -> None:
    shutil.copytree(imported, tmp_path, dirs_exist_ok=True)
    assert "has no page: import writes none" in refused("open", "a", folder=tmp_path)
    (tmp_path / "runs/a/import/report.html").write_text("<script>")
    assert refused("open", "a", folder=tmp_path).endswith("is no file of the artifact; take it out of the folder")


def test_a_page_of_unfinished_work_is_none(run: Path, tmp_path: Path) -> None:
    shutil.move(run, run.with_name(".import.partial"))
    (run.with_name(".import.partial") / "manifest.json").unlink()
    assert refused("open", "a", folder=tmp_path) == "runs/a: holds no complete artifact; build one in it first"


def test_a_run_without_what_it_was_made_from_may_be_whole(run: Path, tmp_path: Path) -> None:
    contents = manifest.read(run).contents
    shutil.copytree(run, child := tmp_path / "runs/b/import")
    seal(child, parents=[{"role": "source", "path": "../../a/import", "hash": contents}])
    shutil.rmtree(run.parent)
    gone = "runs/a/import: is not here, and runs/b/import was made from it"
    assert refused("verify", "b", folder=tmp_path, code=1) == (
        f"{gone}; all that is here is whole; copy it to this place"
    )
    assert gsl("lineage", "b", folder=tmp_path).lines == [f"gsl lineage: {gone}; copy it to this place"]
    assert refused("rerun", "b", folder=tmp_path) == f"{gone}; copy it to this place"
    assert "not here" in done("show", "b", folder=tmp_path).out
    (child / "log.txt").write_text("another")
    said = gsl("verify", "b", folder=tmp_path)
    remedy = f"{gone}; copy it to this place"
    assert said.lines == [remedy, f"gsl verify: runs/b/import: log.txt is not as the manifest says; {AGAIN}"]
    problems = json.loads(gsl("verify", "b", "--json", folder=tmp_path).out)["problems"]
    assert problems["runs/b/import"] == f"log.txt is not as the manifest says; {AGAIN}"


def test_labels_that_no_trajectory_has_are_refused_before_the_audit(run: Path, tmp_path: Path) -> None:
    line = refused("diagnose", "real=a", "sim=nao_ideal", "held_out={kp: 400}", "name=refused", folder=tmp_path)
    assert line == "held_out: no trajectory of the log has {kp: 400}; there kp is None"


NAMED = "a file of your own is taken by its name"


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("my_conf/world/mine.yaml", f"{NAMED}: mine, with --config-dir my_conf"),
        ("./my_conf/world/mine", f"{NAMED}: mine, with --config-dir my_conf"),
        ("path/to/carpet.yaml", f"{NAMED}: carpet, with --config-dir FOLDER, in which it is world/carpet.yaml"),
        ("/nowhere/carpet.yml", f"{NAMED}: carpet, with --config-dir FOLDER, in which it is world/carpet.yaml"),
        ("carpet.yaml", f"{NAMED}: carpet, with --config-dir FOLDER, in which it is world/carpet.yaml"),
        ("runs/a/import", f"{NAMED}: mine, with --config-dir runs/a/import"),
        ("a/import", f"{NAMED}: mine, with --config-dir runs/a/import"),
        ("my_conf/robot.yaml", f"{NAMED}: mine, with --config-dir my_conf"),
        ("arm.urdf", "a robot is a setting of the world urdf: world=urdf world.robot=arm.urdf"),
        ("mine", "it is in my_conf: say --config-dir my_conf"),
        ("nao_wron", "did you mean nao_worn or "),
    ],
)
@pytest.mark.parametrize("role", ["sim", "real"])
def test_a_world_that_is_named_by_its_file_is_told_how(
    role: str, typed: str, said: str, run: Path, tmp_path: Path
) -> None:
    (tmp_path / "my_conf/world").mkdir(parents=True)
    (tmp_path / "my_conf/world/mine.yaml").write_text("defaults: [nao_ideal, _self_]\n")
    line = refused("iterate", f"{role}={typed}", "--cfg", "job", folder=tmp_path)
    assert line.startswith(f"no world called {typed}; ") and said in line


ENTRIES = {
    "a moment that is none here": {"created": "0001-01-01T00:00:00+23:59"},
    "a moment that is none there": {"created": "9999-12-31T23:59:59-23:59"},
    "no time zone": {"created": "2026-01-01T00:00:00"},
    "no moment": {"created": "yesterday"},
    "another unit": {"unit": {"scale": 1.0}},
    "a unit of another kind": {"unit": {"factor": "x"}},
    "a path without end": {"parents": [{"role": "source", "path": "x/" * 60_000, "hash": ""}]},
}


@pytest.mark.parametrize("entries", ENTRIES.values(), ids=ENTRIES)
def test_a_manifest_of_impossible_entries_is_damaged(entries: dict[str, Any], run: Path, tmp_path: Path) -> None:
    seal(run, **entries)
    line = f"runs/a/import/manifest.json: is damaged: its entries do not fit; {AGAIN}"
    assert refused("show", "a/import", folder=tmp_path) == line
    assert done("runs", folder=tmp_path).lines == ["runs/a/import: its manifest cannot be read; gsl verify says why"]


def test_a_lock_of_a_stranger_leads_nowhere(run: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    (run.parent / ".import.lock").symlink_to(elsewhere)
    done("import", "source=log.csv", "mapping=plain", "name=a", "force=true", folder=tmp_path)
    assert not elsewhere.exists()
    assert not (run.parent / ".import.lock").is_symlink()


@pytest.mark.parametrize("shape", ["(0, 99999999999999999999)", "(True,)", "(-1,)"])
def test_an_array_of_an_impossible_shape_is_refused(shape: str, tmp_path: Path) -> None:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("time.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(8))
    line = refused("import", "source=log.npz", "mapping=plain", folder=tmp_path)
    assert line == "log.npz, column time.npy: is no numpy array; save it with numpy.savez"


@pytest.mark.parametrize("row", ["{0:.2f},1e308,-1e308", "{0}e300,0.1,{0}", "{0}e-320,0.1,{0}"])
def test_absurd_numbers_are_told_in_words_alone(row: str, tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    rows = "\n".join(row.format(k / 100) for k in range(60))
    (tmp_path / "log.csv").write_text(f"time,action.a,position.a\n{rows}\n")
    said = gsl("import", "source=log.csv", "mapping=plain", "check=true", folder=tmp_path)
    assert (said.code, said.err, "would be refused (1)" in said.out) == (2, "", True)
    assert not recwarn.list


def test_a_mapping_that_was_changed_counts_in_the_same_process(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(LOG)
    words = ("import", "source=log.csv", "mapping=mine.yaml", "--cfg", "job", "--json")
    for period in (0.01, 0.02):
        (tmp_path / "mine.yaml").write_text(f"defaults: [plain, _self_]\nperiod: {period}\n")
        assert json.loads(done(*words, folder=tmp_path).out)["mapping"]["period"] == period
