"""The chain of commands as a user types it: every stage by the real command line, on toy sizes."""

from __future__ import annotations

import json
from pathlib import Path
from shutil import copytree

import pytest
import yaml
from browser import check_seen
from chains import read_iterate, search
from commands import SMALL, Said, done, gsl
from page_reader import Page, check_alone, words

from gsl.commandline.rerun import rebuild
from gsl.stages.effort import links
from gsl.storage.artifact import Artifact
from gsl.storage.manifest import read
from gsl.storage.policy_choice import find_search

pytestmark = pytest.mark.slow

NAMED = (*SMALL, "name=chain")
FEW = ("optimizer.candidates=4", "optimizer.generations=1", "budget.rollouts=1", "recipe.forward=linear")
WHOLE = ("iterate", *SMALL, *FEW, "grounding=gat", "name=whole", "accept=true", "beside=true")
STAGES = ("collect_real", "collect_sim", "train_forward", "train_inverse", "optimize", "evaluate")


def test_every_stage_leaves_a_complete_artifact(chain: Path) -> None:
    for stage in STAGES:
        folder = chain / "runs/chain" / stage
        there = {path.name for path in folder.iterdir()}
        files = set(json.loads((folder / "manifest.json").read_text())["files"])
        assert {"config.yaml", "metrics.json", "log.txt"} < files
        assert there == files | {"manifest.json"}
    stored = json.loads((chain / "runs/chain/optimize/manifest.json").read_text())
    assert {parent["role"] for parent in stored["parents"]} == {"grounding.forward_model", "grounding.inverse_model"}


def test_nothing_half_written_is_left_behind(chain: Path) -> None:
    assert sorted(path.name for path in (chain / "runs/chain").iterdir()) == sorted(STAGES)


def test_the_same_command_again_does_nothing_however_many_workers_it_has(chain: Path) -> None:
    before = (chain / "runs/chain/collect_real/trajectories.parquet").stat().st_mtime_ns
    again = done("collect", *NAMED, "workers=2", folder=chain)
    assert again.out.splitlines()[-1] == "runs/chain/collect_real (unchanged)"
    assert (chain / "runs/chain/collect_real/trajectories.parquet").stat().st_mtime_ns == before


def test_another_setting_is_refused_and_named(chain: Path) -> None:
    said = gsl("collect", *NAMED, "seed=2", folder=chain)
    assert said.code == 2
    assert said.lines == [
        "gsl collect: runs/chain/collect_real: was built otherwise (changed: seed 1 -> 2); "
        "force=true rebuilds it, another name= keeps both"
    ]


def test_results_are_the_only_thing_on_stdout(chain: Path) -> None:
    document = json.loads(done("evaluate", *NAMED, "--json", folder=chain).out)
    assert document["metrics"]["real_episodes"] > 0 and document["unchanged"] is True


def test_runs_lists_every_artifact_with_what_came_out(chain: Path) -> None:
    text = done("runs", folder=chain).out
    for stage, result in {
        "collect_real": "6 episodes, no falls, π0 ",
        "train_forward": "linear, held out: ",
        "train_inverse": "° of action",
        "optimize": "2 generations, best ",
        "evaluate": " cm/s, no falls in 3",
    }.items():
        line = next(line for line in text.splitlines() if f" chain/{stage} " in line)
        assert result in line


def test_show_tells_where_an_artifact_comes_from_and_what_it_holds(chain: Path) -> None:
    text = done("show", "chain/evaluate", folder=chain).out
    parent = json.loads((chain / "runs/chain/evaluate/manifest.json").read_text())["parents"][0]
    metrics = json.loads((chain / "runs/chain/evaluate/metrics.json").read_text())
    for phrase in (
        "runs/chain/evaluate: evaluate",
        "gsl evaluate name=chain preset=toy",
        f"runs/chain/optimize   {parent['hash'][:12]}   the same",
        "policies in the real world",
        "on the real side [cm/s]",
        "π0, fresh",
        f"{metrics['real_episodes']} real episodes",
        "evaluation.json",
        "all files are as they were made",
    ):
        assert phrase in text
    shown = json.loads(done("show", "chain/evaluate", "--json", folder=chain).out)
    assert shown["manifest"]["kind"] == "evaluate"


@pytest.mark.parametrize("stage", STAGES)
def test_every_artifact_can_be_shown(chain: Path, stage: str) -> None:
    text = done("show", f"chain/{stage}", folder=chain).out
    assert "metrics" not in [line.strip() for line in text.splitlines()]  # the fallback for what nobody can read
    assert "_target_" not in text


def test_show_notices_what_was_changed_since(chain: Path) -> None:
    table = chain / "runs/chain/evaluate/evaluation.json"
    whole = table.read_text()
    table.write_text(whole + " ")
    try:
        said = gsl("show", "chain/evaluate", folder=chain)
        assert said.code == 1
        assert "evaluation.json is not as the manifest says" in said.out
    finally:
        table.write_text(whole)


def test_a_grounding_that_fails_its_check_is_refused_with_the_reason(chain: Path) -> None:
    settings = ("grounding=gat", "grounding.alpha=1.0", "grounding.noise=0.3", "out=runs/chain/refused")
    said = gsl("optimize", *NAMED, *settings, folder=chain)
    assert said.code == 1
    assert "this grounding is refused: " in said.err and "accept=true" in said.err
    assert "forward 10 ticks [mm]" in said.out
    test_nothing_half_written_is_left_behind(chain)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """One iteration."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, done(*WHOLE, folder=folder)


def test_iterate_runs_the_whole_chain_and_says_what_it_cost(whole: tuple[Path, Said]) -> None:
    folder, _ = whole
    metrics = json.loads((folder / "runs/whole/iterate/metrics.json").read_text())
    first = folder / "runs/whole/iteration_01"
    assert {path.name for path in first.iterdir()} == {*STAGES, "optimize_none", "evaluate_none"}
    measured, collected = (
        json.loads((first / stage / "metrics.json").read_text()) for stage in ("evaluate", "collect_real")
    )
    assert metrics["learned_from"] == collected["real_episodes"]
    assert metrics["real_episodes"] == measured["real_episodes"] + collected["real_episodes"]
    made = {path.name for path in (folder / "runs/whole/iterate").iterdir()}
    assert {"policies.json", "learning_curve.png", "joint_trace.png", "walk.png", "table.md"} < made


def test_a_whole_iteration_builds_the_links_that_were_planned(whole: tuple[Path, Said]) -> None:
    run = whole[0] / "runs/whole"
    iterate, _ = rebuild(Artifact(run / "iterate", read(run / "iterate")), ())
    built = [path for path in run.rglob("manifest.json") if path.parent.name != "iterate"]
    assert len(links(iterate)) == len(built) == 8


def test_the_search_behind_a_policy_is_there_for_a_run_and_its_measurement(whole: tuple[Path, Said]) -> None:
    run = whole[0] / "runs/whole"
    for name in ("iterate", "iterate/policies.json", "iteration_01/evaluate", "iteration_01/optimize"):
        search = find_search(run / name)
        assert search and search.folder.resolve() == (run / "iteration_01/optimize").resolve()
    assert find_search(run / "iteration_01/collect_real") is None and find_search(run / "iteration_01") is None


def test_a_search_that_is_damaged_or_of_another_rate_costs_the_page_its_simulator_and_no_measurement(
    chain: Path, tmp_path: Path
) -> None:
    copytree(chain / "runs/chain", tmp_path / "runs/chain")
    fresh = ("evaluate", *SMALL, "episodes=1", "check=1", "confirmation=2")
    said = done(*fresh, "name=finer", "policies=runs/chain/optimize", "world.period=0.01", folder=tmp_path)
    assert "the page shows no simulator: real: acts every 0.01 s" in said.err
    (tmp_path / "runs/chain/optimize/grounding.json").write_text("{")
    said = done(*fresh, "name=again", "policies=runs/chain/evaluate", folder=tmp_path)
    assert "the page shows no simulator: " in said.err and "optimize/grounding.json: is not as the manifest" in said.err
    for name in ("finer", "again"):
        text = (tmp_path / "runs" / name / "evaluate/report.html").read_text("utf-8")
        assert "Joint by joint" in text and "from real" not in text


def test_the_pages_of_an_iteration_have_the_figures_of_its_results(whole: tuple[Path, Said]) -> None:
    run = whole[0] / "runs/whole"
    metrics = json.loads((run / "iterate/metrics.json").read_text())
    pages = {name: (run / name / "report.html").read_text("utf-8") for name in ("iterate", "iteration_01/evaluate")}
    for text in pages.values():
        check_alone(text)
        assert len(text) < 1_500_000 and f"{100.0 * metrics['returned']['value']:.1f}" in words(text)
    said = words(pages["iterate"])
    titles, _, *rows = (run / "iterate/table.md").read_text().split("\n\n")[0].splitlines()
    for row in (titles, *rows):
        assert " ".join(cell for line in row.split("|") if (cell := line.strip())) in said
    for sentence in metrics["verdict"].removesuffix(".").split(". "):  # the last one stands in the headline
        assert f"{sentence}." in said.replace("\xa0", " ")
    seen = Page(pages["iterate"])
    assert len([attribute for attribute in seen.attributes if attribute[1] == "data-of"]) == seen.tags["option"] > 1
    for section in ("Learning curves", "What grounding changes", "Joint by joint", "Footfalls", "Real data", "Lineage"):
        assert section in said
    sides = ("on the real side", "in the grounded simulator")
    assert all(f"{name} {side}" in said for side in sides for name in ("π0", "the returned policy"))
    measured = words(pages["iteration_01/evaluate"])
    assert "Joint by joint: " in measured and "from real" in measured and "What grounding changes" in measured
    assert "../iteration_01/evaluate" in said and "gsl iterate" in said
    check_seen(run / "iterate/report.html", f"{100.0 * metrics['returned']['value']:.1f}")


def test_a_search_and_what_was_collected_have_pages_with_the_figures_of_their_results(chain: Path) -> None:
    run = chain / "runs/chain"
    best, own = (
        json.loads((run / stage / "metrics.json").read_text())[key]
        for stage, key in (("optimize", "best_value_sim"), ("collect_real", "value"))
    )
    shown = {"optimize": f"reaches {100.0 * best:.1f} cm/s in simulation", "collect_real": f"{100.0 * own:.1f} cm/s"}
    for stage, figure in shown.items():
        page = run / stage / "report.html"
        check_alone(page.read_text("utf-8"))
        check_seen(page, figure, f"gsl {stage.partition('_')[0]}", "Real data")
        assert done("open", f"chain/{stage}", folder=chain).out == f"runs/chain/{stage}/report.html\n"


def test_open_names_the_page_where_there_is_no_display_and_says_what_has_none(
    whole: tuple[Path, Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert done("open", "whole", folder=whole[0]).out == "runs/whole/iterate/report.html\n"
    assert (
        done("open", "whole/iteration_01/evaluate", folder=whole[0]).out
        == "runs/whole/iteration_01/evaluate/report.html\n"
    )
    said = gsl("open", "whole/iteration_01/train_forward", folder=whole[0])
    assert said.code == 2 and "has no page: train_forward writes none" in said.err


def test_iterate_ends_with_its_table_on_stdout_and_tells_of_its_stages_on_stderr(whole: tuple[Path, Said]) -> None:
    folder, said = whole
    table = said.out[said.out.index("grounded simulation learning [cm/s]") :]
    rows = [line.split()[:2] for line in table.splitlines() if line.startswith("  ") and line.strip()][1:4]
    metrics = json.loads((folder / "runs/whole/iterate/metrics.json").read_text())
    assert [row[0] for row in rows] == ["0", "1", "no"]
    assert rows[0][1] == "π0"
    assert said.out.count("grounded simulation learning") == 1
    spent, learned = metrics["real_episodes"], metrics["learned_from"]
    beside = f"{metrics['ungrounded']['real_episodes']} more to measure the search without grounding"
    assert (
        f"real data: {learned} episodes to learn from, {spent - learned} to measure, {spent} in all; {beside}\n"
        in table
    )
    assert metrics["verdict"] in table
    plots = "plots: runs/whole/iterate/ (joint_trace.png, learning_curve.png, walk.png)"
    assert f"{plots}\npage: runs/whole/iterate/report.html\n" in table
    assert table.splitlines()[-1] == "runs/whole/iterate"
    grown = [line for line in said.lines if line.startswith("  ")]
    assert grown[0].split()[:2] == ["iteration", "policy"]
    assert grown[1].index("π0") == grown[2].index(rows[1][1]) == grown[0].index("policy")
    for stage in STAGES:
        assert any(line.startswith(f"runs/whole/iteration_01/{stage}: ") for line in said.lines)


def test_an_unchanged_iteration_shows_its_table_again(whole: tuple[Path, Said]) -> None:
    folder, said = whole
    again = done(*WHOLE, folder=folder)
    start = said.out.index("grounded simulation learning [cm/s]")
    assert again.out == said.out[start:].replace("runs/whole/iterate\n", "runs/whole/iterate (unchanged)\n")


@pytest.mark.parametrize("grounding", ["gat_residual", "gat_gated"])
def test_models_of_two_joints_ground_no_others(grounding: str, tmp_path: Path) -> None:
    line = ("experiment=arm", "preset=toy", f"grounding={grounding}", "grounding.x=auto", "accept=true", "workers=1")
    artifact = search(read_iterate(*line, "forward_model.epochs=5", "task.duration=1.2"), tmp_path)
    assert set(artifact.metrics["x"]) <= {"LShoulderPitch", "RShoulderPitch"}
    assert json.loads((artifact.folder / "grounding.json").read_text())["reachability"]["by_joint"].keys() == {
        "LShoulderPitch",
        "RShoulderPitch",
    }
    trained = yaml.safe_load((tmp_path / "train_forward/config.yaml").read_text())["model"]
    assert (trained["likelihood"], trained["members"]) == ("point", 5 if grounding == "gat_gated" else 1)


def test_a_link_that_takes_another_ones_place_is_told(tmp_path: Path) -> None:
    line = ("iterate", "experiment=arm", "preset=toy", "task.duration=1.2", "workers=1", "name=chain")
    line += ("grounding=none", "optimizer.generations=1")
    assert "in the place of" not in done(*line, folder=tmp_path).err
    said = done(*line, "seed=2", "force=true", folder=tmp_path)
    assert "runs/chain/iteration_01/optimize: in the place of what a chain with other settings had built" in said.err
