"""What an artifact says of itself and of all that it was made from is checked, drawn and done again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import done, gsl, refused
from strangers import seal

from gsl.commandline.rerun import AGAIN
from gsl.storage.manifest import REMEDY

pytestmark = pytest.mark.slow

Damage = Callable[[Path], object]


@pytest.fixture
def run(chain: Path, tmp_path: Path) -> Path:
    """A copy of the chain's folder, in which everything may be damaged."""
    shutil.copytree(chain / "runs", tmp_path / "runs", ignore=shutil.ignore_patterns("refused"))
    return tmp_path


def flip(path: Path) -> None:
    contents = bytearray(path.read_bytes())
    contents[len(contents) // 2] ^= 4
    path.write_bytes(contents)


def without_hash(path: Path) -> None:
    stored = json.loads(path.read_text())
    path.write_text(json.dumps({**stored, "files": {}}))


DAMAGE: dict[str, tuple[Damage, str, str]] = {
    "its own payload": (lambda runs: flip(runs / "evaluate/policies.json"), "evaluate", "policies.json is not as"),
    "its settings": (lambda runs: flip(runs / "evaluate/config.yaml"), "evaluate", "config.yaml is not as"),
    "its parent": (lambda runs: flip(runs / "optimize/policies.json"), "optimize", "policies.json is not as"),
    "the first log": (
        lambda runs: flip(runs / "collect_real/trajectories.parquet"), "collect_real", "trajectories.parquet is not as",
    ),
    "a log that is gone": (lambda runs: shutil.rmtree(runs / "collect_sim"), "collect_sim", "is not here, and runs"),
    "a manifest": (
        lambda runs: flip(runs / "train_inverse/manifest.json"), "train_inverse: manifest.json", "is damaged",
    ),
    "no files": (
        lambda runs: without_hash(runs / "train_forward/manifest.json"), "train_forward: manifest.json", "is damaged",
    ),
    "a file too many": (
        lambda runs: (runs / "collect_real/more.parquet").write_text(""), "collect_real", "more.parquet is no file",
    ),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGE)
def test_verify_names_what_is_wrong_however_far_back(damage: str, run: Path) -> None:
    act, where, what = DAMAGE[damage]
    act(run / "runs/chain")
    said = gsl("verify", "chain/evaluate", folder=run)
    assert (said.code, said.out) == (1, "")
    [line] = said.lines
    assert line.startswith("gsl verify: ")
    assert where in line
    assert what in line


def test_verify_finds_nothing_wrong_where_nothing_is(chain: Path) -> None:
    assert done("verify", "chain/evaluate", folder=chain).out == (
        "1 of 1 artifacts are as they were made, and 5 ancestors too\n"
    )
    assert done("verify", "chain", folder=chain).out == "6 of 6 artifacts are as they were made\n"
    said = json.loads(done("verify", "chain", "--json", folder=chain).out)
    assert said == {"artifacts": 6, "ancestors": 0, "problems": {}}


def test_verify_of_all_runs_goes_on_after_the_first_problem(run: Path) -> None:
    for stage in ("optimize", "collect_sim"):
        flip(run / "runs/chain" / stage / "metrics.json")
    said = gsl("verify", folder=run)
    assert said.code == 1
    assert len(said.lines) == 2
    assert said.lines[-1].startswith("gsl verify: ")
    assert all(any(stage in line for line in said.lines) for stage in ("optimize", "collect_sim"))
    assert json.loads(gsl("verify", "--json", folder=run).out)["exit_code"] == 1


def test_the_lineage_is_a_tree_down_to_the_logs(run: Path) -> None:
    lines = done("lineage", "chain/evaluate", folder=run).out.splitlines()
    order = ["evaluate", "optimize", "train_forward", "collect_real", "train_inverse", "collect_sim"]
    assert [next(i for i, line in enumerate(lines) if f"runs/chain/{name} " in line) for name in order] == [*range(6)]
    shutil.rmtree(run / "runs/chain/collect_sim")
    said = gsl("lineage", "chain/evaluate", folder=run)
    assert (said.code, "is not here" in said.out, "is not here" in said.lines[-1]) == (1, True, True)
    tree = json.loads(gsl("lineage", "chain/optimize", "--json", folder=run).out)
    assert [parent["role"] for parent in tree["parents"]] == ["grounding.forward_model", "grounding.inverse_model"]


@pytest.mark.parametrize("stage", ["train_forward", "evaluate"])
def test_a_rerun_comes_to_the_same_payload_in_another_place(stage: str, run: Path) -> None:
    moved = run / "runs" / "moved"
    (run / "runs/chain").rename(moved)
    said = done("rerun", f"moved/{stage}", folder=run)
    assert said.out.endswith(f"runs/moved{AGAIN}/{stage}\n")
    assert "differs" not in said.out
    again = gsl("rerun", f"moved/{stage}", folder=run)
    assert (again.code, again.lines) == (
        2,
        [f"gsl rerun: runs/moved{AGAIN}/{stage}: exists; take it away or choose another out="],
    )


THEIRS = """from gsl.core.setting import component
from gsl.worlds.bullet import BulletWorld


@component
class Theirs(BulletWorld):
    pass
"""


def test_a_run_with_a_class_of_a_colleague_is_repeated_if_it_is_trusted(tmp_path: Path) -> None:
    (tmp_path / "theirs.py").write_text(THEIRS)
    (tmp_path / "mine/world").mkdir(parents=True)
    (tmp_path / "mine/world/theirs.yaml").write_text("defaults: [nao_ideal, _self_]\n_target_: theirs.Theirs\n")
    words = ("--config-dir", "mine", "world=theirs", "trust=theirs", "name=own")
    done("collect", *words, "preset=toy", "task.duration=1.0", "workers=1", folder=tmp_path)
    assert "say trust=theirs" in gsl("rerun", "own/collect_real", folder=tmp_path).err
    assert "differs" not in done("rerun", "own/collect_real", "trust=theirs", folder=tmp_path).out


def test_settings_that_name_no_stage_are_refused(run: Path) -> None:
    config = run / "runs/chain/collect_sim/config.yaml"
    config.write_text("\n".join(line for line in config.read_text().splitlines() if not line.startswith("_target_")))
    seal(config.parent)
    said = gsl("rerun", "chain/collect_sim", folder=run)
    assert (said.code, "config.yaml: names no stage" in said.lines[-1]) == (2, True)


def test_a_rerun_of_other_parents_or_with_another_result_says_so(run: Path) -> None:
    config = run / "runs/chain/collect_sim/config.yaml"
    config.write_text(config.read_text().replace("\nseed: 1\n", "\nseed: 2\n"))
    seal(config.parent)
    said = gsl("rerun", "chain/collect_sim", "out=again", folder=run)
    assert said.code == 1
    assert "another payload than runs/chain/collect_sim: " in said.lines[-1]
    assert "trajectories.parquet" in said.lines[-1]
    done("collect", "role=sim", "name=chain", "preset=toy", "task.duration=1.0", "workers=1", "force=true", folder=run)
    said = gsl("rerun", "chain/train_inverse", folder=run)
    assert said.code == 2
    assert "is no longer what runs/chain/train_inverse was made from" in said.lines[-1]


def test_who_uses_what_was_made_from_other_data_is_warned(run: Path) -> None:
    """The direct parent is as it was, but its own parent was built anew."""
    small = ("preset=toy", "task.duration=1.6", "workers=1")
    again = ("optimize", "name=chain", *small, "grounding=gat", "accept=true")
    assert "warning" not in done(*again, folder=run).err
    done("collect", "role=sim", "name=chain", "preset=toy", "task.duration=1.0", "workers=1", "force=true", folder=run)
    said = done(*again, folder=run)
    assert "(unchanged)" in said.out
    [line] = [line for line in said.lines if "warning" in line]
    assert "runs/chain/collect_sim was built anew since runs/chain/train_inverse was made from it" in line
    assert [line] == done("show", "chain/train_inverse", folder=run).lines


def test_verify_says_what_is_missing_and_needs_something_to_verify(run: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    assert refused("verify", folder=mine).startswith("runs: holds no artifact, so nothing is verified")
    shutil.copytree(run / "runs/chain/collect_real", mine / "runs/mine/collect_real")
    for name, problem in (
        ("trajectories.parquet", f"trajectories.parquet is missing; {REMEDY}"),
        ("manifest.json", "is no complete artifact: it holds no manifest.json"),
    ):
        (mine / "runs/mine/collect_real" / name).unlink()
        said = gsl("verify", folder=mine)
        assert (said.code, said.lines) == (1, [f"gsl verify: runs/mine/collect_real: {problem}"])


def test_a_damaged_artifact_is_shown_and_ends_in_1(run: Path) -> None:
    for name in ("trajectories.parquet", "metrics.json", "config.yaml"):
        folder = run / "runs/chain/collect_real"
        whole = (folder / name).read_bytes()
        (folder / name).write_bytes(b"\xff{")
        said = gsl("show", "chain/collect_real", folder=run)
        assert said.code == 1
        assert said.lines == [f"gsl show: runs/chain/collect_real/{name}: is not as the manifest says; {REMEDY}"]
        assert "gsl collect" in said.out
        assert json.loads(gsl("show", "chain/collect_real", "--json", folder=run).out)["exit_code"] == 1
        assert "chain/optimize" in done("runs", folder=run).out
        (folder / name).write_bytes(whole)
    (run / "runs/chain/collect_real/manifest.json").write_bytes(b"\xff")
    said = done("runs", folder=run)
    assert "chain/optimize" in said.out
    assert said.lines == ["runs/chain/collect_real: its manifest cannot be read; gsl verify says why"]


def test_a_rerun_of_a_damaged_artifact_says_where_the_payload_is(run: Path) -> None:
    flip(run / "runs/chain/collect_real/trajectories.parquet")
    said = gsl("rerun", "chain/collect_real", folder=run)
    damaged = f"runs/chain/collect_real/trajectories.parquet: is not as the manifest says; {REMEDY}"
    there = f"runs/chain{AGAIN}/collect_real holds what was made"
    assert (said.code, said.lines[-1]) == (1, f"gsl rerun: {damaged}; {there}")


def test_no_page_of_a_damaged_artifact_is_opened(run: Path) -> None:
    flip(run / "runs/chain/optimize/policies.json")
    said = gsl("open", "chain/optimize", folder=run)
    assert said.code != 0
    assert said.lines == [f"gsl open: runs/chain/optimize/policies.json: is not as the manifest says; {REMEDY}"]


def test_what_was_made_from_a_damaged_artifact_is_not_removed_as_stale(run: Path) -> None:
    (run / "runs/chain/optimize/manifest.json").write_bytes(b"{")
    assert "nothing below runs/ could go" in done("clean", "stale=true", folder=run).out


def test_a_run_whose_settings_were_changed_is_not_run_again(run: Path) -> None:
    config = run / "runs/chain/optimize/config.yaml"
    config.write_text(config.read_text().replace("seed: ", "seed: 7"))
    said = gsl("rerun", "chain/optimize", folder=run)
    assert said.code == 2 and "config.yaml: is not as the manifest says" in said.err
    assert not (run / "runs" / f"chain{AGAIN}").exists()
