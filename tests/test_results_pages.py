"""The commands of docs/results tell what is committed beside them: nothing is run anew, tables are of its trials."""

from __future__ import annotations

import json
import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from gsl.commandline.composer import compose, opened
from gsl.config import prepared, resolved
from gsl.stages.headline import Unit
from gsl.studies.budget import Budget
from gsl.studies.compare import Compare
from gsl.studies.comparison import summaries
from gsl.studies.comparison_table import markdown
from gsl.studies.ledger import recipes
from gsl.studies.paper_cells import one_by_one
from gsl.studies.replays import Replays
from gsl.studies.reproduce import Reproduce
from gsl.studies.trial import Trial

ROOT = Path(__file__).parents[1]
PAGES = [*sorted((ROOT / "docs/results").glob("*.md")), ROOT / "docs/environments.md"]
KNOWN = re.compile(r"(?:known=\[?|,)(docs/results/[^\s,\]]+\.json)")


@cache
def told() -> list[list[str]]:
    """Every command of a page that takes known results, as a shell gives it to gsl."""
    found = []
    for page in PAGES:
        for block in re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                if line.startswith("$ gsl ") and KNOWN.search(line):
                    typed = f"printf '%s\\n' {line.removeprefix('$ gsl ')}"
                    said = subprocess.run(["bash", "-c", typed], capture_output=True, text=True, check=True)
                    found.append(said.stdout.splitlines())
    return found


def composed(typed: list[str]) -> Any:
    what, rest = (f"reproduce_{typed[1]}", typed[2:]) if typed[0] == "reproduce" else (typed[0], typed[1:])
    with opened(None):
        return prepared(resolved(compose(what.replace("-", "_"), rest)))[0]


def test_pages_have_such_commands() -> None:
    assert len(told()) >= 13


@pytest.mark.parametrize("typed", told(), ids=lambda typed: KNOWN.findall(" ".join(typed))[0])
def test_a_page_tells_what_is_committed(typed: list[str]) -> None:
    files = [ROOT / name for name in KNOWN.findall(" ".join(typed))]
    rows = [row for file in files for row in json.loads(file.read_text(encoding="utf-8"))]
    study = composed(typed)
    for kind, names in {Replays: ("trial", "world", "method"), Budget: ("trial", "method", "trajectories")}.items():
        if isinstance(study, kind):
            assert study.recipes == {tuple(row[name] for name in names): row["recipe"] for row in rows}
            return
    if not isinstance(study, Compare):
        assert recipes(study).items() <= {row["trial"]: row["recipe"] for row in rows}.items()
        return
    keys = study.recipes
    of = {row["recipe"]: [] for row in rows}
    for row in rows:
        of[row["recipe"]].append(Trial(**{name: row[name] for name in Trial._fields if name in row}))
    for (number, cell), key in keys.items():
        told_of = {(one.number, one.simulator, one.world, one.method) for one in of[key]}
        assert told_of == {(number, cell.simulator, cell.world, cell.method)}
    trials = sorted((trial for key in keys.values() for trial in of[key]), key=lambda trial: trial.number)
    name = next((one.removeprefix("name=") for one in typed if one.startswith("name=")), "")
    folder = files[0].parent if len(files) == 1 else ROOT / "docs/results" / name
    table, task = folder / "table.md", study.iterate.task
    if isinstance(study, Reproduce):
        assert (folder / "trials.md").read_text(encoding="utf-8") == one_by_one(trials, task)
        text = study.table.markdown(trials, task)
    elif table.is_file():
        text = markdown(summaries(trials), trials, Unit.of(task))
    else:
        return
    assert text.strip() in table.read_text(encoding="utf-8")


def by_number(study: Any) -> dict[int, set[str]]:
    """The recipes of each trial."""
    found: dict[int, set[str]] = {}
    for cell, key in (study.recipes if hasattr(study, "recipes") else recipes(study)).items():
        found.setdefault(cell if isinstance(cell, int) else cell[0], set()).add(key)
    return found


@pytest.mark.parametrize("name", ["fig12", "budget", "replays", "table2"])
def test_trials_are_the_same_wherever_a_study_begins(name: str) -> None:
    """Otherwise several machines could not share them."""
    whole, last = (by_number(composed(["reproduce", name, "trials=3", first])) for first in ("first=1", "first=3"))
    assert list(last) == [3, 4, 5] and last[3] == whole[3] and last[3].isdisjoint(last[4])


def tables(text: str) -> list[tuple[list[str], list[list[str]]]]:
    """Return the tables of a page, titles and rows."""
    found = []
    for block in re.findall(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE):
        titles, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in block.splitlines())
        found.append((titles, rows))
    return found


def places_of(titles: list[str], among: list[str]) -> list[int]:
    """Return where titles stand among others, in their order; nothing if they do not all."""
    places = list[int]()
    for title in titles:
        rest = among[places[-1] + 1 :] if places else among
        if title not in rest:
            return []
        places.append(len(among) - len(rest) + rest.index(title))
    return places


def test_a_page_repeats_its_tables_to_the_letter() -> None:
    repeated = set()
    for page in PAGES[:-1]:
        text = page.read_text(encoding="utf-8")
        folders = {ROOT / name for name in re.findall(r"docs/results/\w+(?=/)", text)}
        whole = [one for folder in folders for one in tables((folder / "table.md").read_text(encoding="utf-8"))]
        for titles, rows in tables(text):
            kept = [(places_of(titles, every), below) for every, below in whole]
            there = [[row[place] for place in places] for places, below in kept if places for row in below]
            if there:
                repeated.add(page.stem)
                assert [row for row in rows if row not in there] == [], page
    assert repeated >= {"table2", "table2-paper", "table4", "linear-walk", "worlds", "fig12", "fig13", "garat"}
