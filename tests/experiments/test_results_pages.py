"""The commands of docs/results tell what is committed beside them: nothing is run anew, tables are of its trials."""

from __future__ import annotations

import json
import re
import subprocess
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.core.unit import Unit
from gsl_experiments import budget, noise_table
from gsl_experiments.budget import Budget
from gsl_experiments.compare import Compare
from gsl_experiments.comparison import differences, summaries
from gsl_experiments.comparison_table import bounds, format_difference, markdown
from gsl_experiments.noise import NoiseStudy
from gsl_experiments.replays import Replay, Replays
from gsl_experiments.reproduce import Reproduce
from gsl_experiments.trial import Trial
from gsl_experiments.tried import foretelling

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PLACE, TRIALS = ROOT / "docs/results", ROOT / "experiments/trials"
PAGES = [*sorted(PLACE.glob("*.md")), ROOT / "docs/howto/own-environment.md"]
# What a row of a study is, and which of its fields its recipes go by.
CELLS: dict[type, tuple[Any, ...]] = {
    Replays: (Replay, "trial", "world", "method"),
    Budget: (budget.Point, "trial", "method", "trajectories"),
    NoiseStudy: (noise_table.Point, "trial"),
}
KNOWN = re.compile(r"(?:known=\[?|,)(experiments/trials/[^\s,\]]+\.json)")


@cache
def told() -> list[list[str]]:
    """Every command of a page that takes known results, as a shell gives it to gsl."""
    outputs = []
    for page in PAGES:
        for block in re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                if line.startswith("$ gsl ") and KNOWN.search(line):
                    typed = f"printf '%s\\n' {line.removeprefix('$ gsl ')}"
                    said = subprocess.run(["bash", "-c", typed], capture_output=True, text=True, check=True)
                    outputs.append(said.stdout.splitlines())
    return outputs


def as_trial(row: dict[str, Any]) -> Trial:
    return Trial.read({name: row[name] for name in Trial._fields if name in row})


def composed(typed: list[str]) -> Any:
    what, rest = (f"reproduce_{typed[1]}", typed[2:]) if typed[0] == "reproduce" else (typed[0], typed[1:])
    with open_hydra(None):
        composition = compose(what.replace("-", "_"), rest)
        return prepare(resolve(composition), composition.trust)[0]


def test_pages_have_such_commands() -> None:
    assert len(told()) >= 13


@pytest.mark.parametrize("typed", told(), ids=lambda typed: KNOWN.findall(" ".join(typed))[0])
def test_a_page_tells_what_is_committed(typed: list[str], tmp_path: Path) -> None:
    files = [ROOT / name for name in KNOWN.findall(" ".join(typed))]
    rows = [row for file in files for row in json.loads(file.read_text(encoding="utf-8"))]
    study = composed(typed)
    keys = study.recipes
    if not isinstance(study, Compare):
        kind, *names = CELLS[type(study)]
        cells = {
            row[names[0]] if len(names) == 1 else tuple(row[name] for name in names): row["recipe"] for row in rows
        }
        assert keys.items() <= cells.items()
        assert isinstance(study, NoiseStudy) or len(keys) == len(rows)  # whose files hold no more than is told
        rows = [row for row in rows if row["recipe"] in keys.values()]
        study.tell(tmp_path, [kind(**{name: row.get(name) for name in kind._fields}) for row in rows], "")
        words_seen = (PLACE / files[0].parent.name / "table.md").read_text(encoding="utf-8")
        assert words_seen.startswith((tmp_path / "table.md").read_text(encoding="utf-8").strip())
        return
    of = {row["recipe"]: [] for row in rows}
    for row in rows:
        of[row["recipe"]].append(as_trial(row))
    for (number, cell), key in keys.items():
        told_of = {(trial.number, trial.simulator, trial.world, trial.method) for trial in of[key]}
        assert told_of == {(number, cell.simulator, cell.world, cell.method)}
    trials = sorted((trial for key in keys.values() for trial in of[key]), key=lambda trial: trial.number)
    name = next((word.removeprefix("name=") for word in typed if word.startswith("name=")), "")
    folder = PLACE / (files[0].parent.name if len(files) == 1 else name)
    table, task = folder / "table.md", study.iterate.task
    text = (
        study.table.markdown(trials, task)
        if isinstance(study, Reproduce)
        else markdown(summaries(trials), trials, Unit.of(task))
    )
    assert text.strip() in table.read_text(encoding="utf-8")
    foretold = foretelling(trials).strip()
    assert foretold in table.read_text(encoding="utf-8")
    assert bool(foretold) == ("What predicts falls" in table.read_text(encoding="utf-8"))


def trials_of(*names: str) -> list[Trial]:
    """The trials of committed studies of one iteration."""
    rows = [row for name in names for row in json.loads((TRIALS / name / "trials.json").read_text("utf-8"))]
    return [as_trial(row) for row in rows]


def test_the_aims_of_table_2_stand_beside_its_trials() -> None:
    """Of the first ten trials, of all twenty, and of ten in which the real world is the simulator."""
    ten, twenty = trials_of("table2"), trials_of("table2", "table2_again")
    whole = (ROOT / "docs/results/table2.md").read_text(encoding="utf-8")
    rows = next(rows for _, titles, rows in tables(whole) if titles[:3] == ["real world", "trials", "grounding"])
    assert len(rows) == 20
    for place, count, named, gain, more, without, unimproved, spent in rows:
        world, method = place.strip("`"), named.strip("`")
        among = ten if count == "10" else twenty
        if method.startswith("no gap"):
            without_gap = [trial._replace(method=method) for trial in trials_of(world.replace("nao", "table2_in"))]
            among = [*among, *(trial for trial in without_gap if trial.world == world)]
        own = [trial for trial in among if (trial.world, trial.method) == (world, method)]
        (summary,) = summaries(own)
        assert summary.improvement is not None and summary.trials == int(count)
        assert gain == f"{summary.improvement.mean:.1f} ({bounds(summary.improvement)})"
        assert more == ("" if method == "none" else format_difference(differences(among, own[0].cell, "none")))
        assert (without, unimproved) == (f"{summary.without} of {count}", f"{summary.unimproved} of {count}")
        assert spent == f"{summary.real_episodes:.0f}"


def test_what_gains_no_more_in_table_2_is_as_its_trials_say() -> None:
    ten = trials_of("table2")
    whole = (ROOT / "docs/results/table2.md").read_text(encoding="utf-8")
    _, (_, *places, _), rows = next(table for table in tables(whole) if table[1][0] == "not above")
    assert [row[0].strip("`") for row in rows] == ["sgat", "identified", "randomised", "effects_sgat"]
    for method, *gains, _ in rows:
        for place, gain in zip(places, gains, strict=True):
            world = place.split("`")[1]
            (summary,) = summaries([each for each in ten if (each.world, each.method) == (world, method.strip("`"))])
            assert summary.improvement is not None
            assert gain == f"{summary.improvement.mean:.1f} ({bounds(summary.improvement)})"


def test_the_guide_tells_gains_and_falls_of_the_trials() -> None:
    """Of a policy that was returned, and of those that were tried."""
    guide = (ROOT / "docs/explanation/grounding.md").read_text(encoding="utf-8")
    _, (_, *worlds), rows = next(table for table in tables(guide) if "`nao_harsh`" in table[1])
    ten, twenty = trials_of("table2"), trials_of("table2", "table2_again")
    itself = [
        trial._replace(method="learned in this world itself") for trial in trials_of("table2_in_weak", "table2_in_worn")
    ]
    loaded = [trial for trial in trials_of("servo") if trial.method == "servo_torque_noise"]
    bare = [trial for trial in trials_of("servo_weak", "servo_worn", "servo_harsh") if trial.method == "servo"]
    elsewhere = {"`nao_worn`, its causes withheld": trials_of("withheld")}
    count = 0
    for named, *cells in rows:
        method = named.strip("`")
        first = twenty if method in {trial.method for trial in trials_of("table2_again")} else [*ten, *itself]
        for title, cell in zip(worlds, cells, strict=True):
            among = elsewhere.get(title, [*first, *loaded, *bare, *trials_of("worlds")])
            own = [trial for trial in among if (trial.world, trial.method) == (title.split("`")[1], method)]
            gain = sum(trial.improvement for trial in own) / max(len(own), 1)
            fell = (
                100 * sum(trial.winners - trial.stable for trial in own) / max(sum(trial.winners for trial in own), 1)
            )
            assert cell == (f"{gain:.1f} ({fell:.0f})" if own else ""), (method, title)
            count += bool(cell)
    assert count == 38


def by_number(study: Any) -> dict[int, set[str]]:
    """The recipes of each trial."""
    keys: dict[int, set[str]] = {}
    for cell, key in study.recipes.items():
        keys.setdefault(cell if isinstance(cell, int) else cell[0], set()).add(key)
    return keys


@pytest.mark.parametrize("name", ["fig12", "budget", "replays", "table2"])
def test_trials_are_the_same_wherever_a_study_begins(name: str) -> None:
    """Otherwise several machines could not share them."""
    whole, last = (by_number(composed(["reproduce", name, "trials=3", first])) for first in ("first=1", "first=3"))
    assert list(last) == [3, 4, 5] and last[3] == whole[3] and last[3].isdisjoint(last[4])


def tables(text: str) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return the tables of a page: the line before each, titles and rows."""
    blocks = []
    for block in re.finditer(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE):
        titles, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in block[0].splitlines())
        blocks.append((text[: block.start()].rstrip().rpartition("\n")[2], titles, rows))
    return blocks


def positions(titles: list[str], among: list[str]) -> list[int]:
    """Return where titles stand among others, in their order; nothing if they do not all."""
    places = list[int]()
    for title in titles:
        begin = places[-1] + 1 if places else 0
        if title not in among[begin:]:
            return []
        places.append(among.index(title, begin))
    return places


def parts(titles: list[str], whole: str) -> dict[tuple[str, ...], list[list[str]]]:
    """Return the rows of these columns, by the worlds that stand in none of them."""
    groups: dict[tuple[str, ...], list[list[str]]] = {}
    for _, every, rows in tables(whole):
        kept = positions(titles, every)
        worlds = [k for k, title in enumerate(every) if title in ("simulator", "real world") and k not in kept]
        for row in rows if kept else ():
            groups.setdefault(tuple(row[k] for k in worlds), []).append([row[k] for k in kept])
    return groups


def test_a_page_repeats_its_tables_to_the_letter() -> None:
    repeated = Counter[str]()
    for page in PAGES[:-1]:
        text = page.read_text(encoding="utf-8")
        folders = {PLACE / name for name in re.findall(r"(?:docs/results|(?:=\[?|,)experiments/trials)/(\w+)/", text)}
        whole = [(folder / "table.md").read_text(encoding="utf-8") for folder in folders]
        for before, titles, rows in tables(text):
            of = [part for part in (parts(titles, row) for row in whole) if part]
            if of:
                repeated[page.stem] += 1
                same = [(len(part), worlds) for part in of for worlds, below in part.items() if below == rows]
                assert any(count == 1 or all(name in before for name in worlds) for count, worlds in same), page
    once = ("budget", "fig13", "fig5", "garat", "linear-walk", "table2-paper", "table3", "table4", "withheld", "worlds")
    several = {"fig12": 2, "replays": 2}
    assert repeated == {**dict.fromkeys(once, 1), **several}
