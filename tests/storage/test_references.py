from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from gsl.errors import ArtifactError
from gsl.storage.artifact import build
from gsl.storage.references import find_all, load, resolve


class Noting:
    """A stage of any kind that writes a note."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        (folder / "note").write_text(self.kind)
        return {}


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for place, kind in (
        ("quick-start/collect", "collect"),
        ("quick-start/optimize", "optimize"),
        ("study/iteration_01/optimize", "optimize"),
        ("study/iteration_02/optimize", "optimize"),
        ("study/killed", "evaluate"),
    ):
        build(Noting(kind), config={}, out=Path("runs") / place, command="", force=False, console=None)
    Path("runs/study/killed").rename("runs/study/.optimize.partial")
    return Path("runs")


def test_a_run_name_means_its_only_artifact_of_the_kind(runs: Path) -> None:
    assert resolve("quick-start", kind="optimize") == runs / "quick-start/optimize"
    assert resolve("study/iteration_02", kind="optimize") == runs / "study/iteration_02/optimize"


def test_a_path_and_a_way_into_a_run_are_references(runs: Path) -> None:
    for reference in ("runs/quick-start/collect", "quick-start/collect", (runs / "quick-start/collect").resolve()):
        assert resolve(reference, kind="collect").samefile(runs / "quick-start/collect")
    assert resolve("runs/quick-start", kind="collect") == runs / "quick-start/collect"
    assert resolve("quick-start/collect/note", kind="collect") == runs / "quick-start/collect/note"


def test_several_that_fit_are_listed(runs: Path) -> None:
    with pytest.raises(ArtifactError, match="study/iteration_01/optimize, study/iteration_02/optimize"):
        resolve("study", kind="optimize")
    with pytest.raises(ArtifactError, match="quick-start/collect, quick-start/optimize"):
        resolve("quick-start")


def test_the_likely_name_is_suggested(runs: Path) -> None:
    with pytest.raises(ArtifactError, match="did you mean quick-start?"):
        resolve("quick_start", kind="optimize")
    with pytest.raises(ArtifactError, match="did you mean quick-start/optimize?"):
        resolve("quick-start/optimise")
    with pytest.raises(ArtifactError, match="did you mean quick-start/optimize?"):
        resolve("quikc-start/optimize")
    with pytest.raises(ArtifactError, match=r"mean study/iteration_01/optimize or study/iteration_02/optimize\?$"):
        resolve("study/optimize", kind="optimize")
    with pytest.raises(ArtifactError, match=r"mean study/iteration_01/optimize or study/iteration_02/optimize\?$"):
        resolve("study/optimise")
    with pytest.raises(ArtifactError, match="; gsl train-forward name=mine makes it$"):
        resolve("mine/train_forward")
    with pytest.raises(ArtifactError, match="; gsl train-servo name=mine makes it$"):
        resolve("mine/train_servo")
    with pytest.raises(ArtifactError, match="no such run"):
        resolve("anything", runs=Path("nowhere"))
    with pytest.raises(ArtifactError, match="empty"):
        resolve("")


def test_a_wrong_kind_is_refused_with_both_names(runs: Path) -> None:
    for reference in ("quick-start/collect", "runs/quick-start/collect"):
        with pytest.raises(ArtifactError, match="holds collect, but optimize is needed"):
            load(reference, "optimize")
    with pytest.raises(ArtifactError, match="holds collect, optimize, but evaluate is needed"):
        resolve("quick-start", kind="evaluate")


def test_unfinished_work_is_not_found(runs: Path) -> None:
    with pytest.raises(ArtifactError, match="evaluate is needed"):
        resolve("study", kind="evaluate")


def test_a_changed_or_missing_file_is_noticed_on_loading(runs: Path) -> None:
    note = runs / "quick-start/optimize/note"
    assert load("quick-start", "optimize").manifest.kind == "optimize"
    note.write_text("optimise")
    with pytest.raises(ArtifactError, match="note"):
        load("quick-start", "optimize")
    note.unlink()
    with pytest.raises(ArtifactError, match="note"):
        load("quick-start", "optimize")


def test_a_file_is_no_artifact_to_load(runs: Path) -> None:
    with pytest.raises(ArtifactError, match="no complete artifact"):
        load("quick-start/collect/note", "collect")


def test_every_complete_artifact_is_listed_and_nothing_else(runs: Path) -> None:
    (runs / "foreign").mkdir()
    (runs / "foreign/manifest.json").write_text("{}")
    folders = [artifact.folder.relative_to(runs).as_posix() for artifact in find_all(runs)]
    assert sorted(folders) == [
        "quick-start/collect",
        "quick-start/optimize",
        "study/iteration_01/optimize",
        "study/iteration_02/optimize",
    ]
    assert find_all(Path("nowhere")) == []


def test_a_choice_among_very_many_has_an_end(runs: Path) -> None:
    for k in range(23):
        shutil.copytree(runs / "quick-start/collect", runs / f"many/r{k:02d}/collect")
    with pytest.raises(ArtifactError, match=r"name one of them: many/r00/collect, .*, many/r19/collect and 3 more$"):
        resolve("many")
