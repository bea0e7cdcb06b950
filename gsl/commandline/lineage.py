"""The lineage of an artifact for `gsl verify`, which checks it, and `gsl lineage`, which draws it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from gsl.core.visible import visible
from gsl.core.words import several
from gsl.errors import ArtifactError
from gsl.report.console import Console
from gsl.storage.hashing import SHORT
from gsl.storage.lineage import Ancestor, Seen, lineage
from gsl.storage.references import RUNS, artifact_folders, resolve_main

if TYPE_CHECKING:
    from rich.tree import Tree


def verify(reference: str | None, console: Console) -> int:
    """Hash artifacts and all that they were made from again; return 1 if something is not as it was.

    Args:
        reference: A path, or the name of a run; None for all below runs/.
        console: Where the first thing that is wrong is said last.

    Raises:
        ArtifactError: There is no such artifact.
    """
    wrong, above = dict[Path, Ancestor](), set[Path]()
    seen: Seen = {}
    folders = artifact_folders(reference)
    if not folders:
        raise ArtifactError(RUNS, "holds no artifact, so nothing is verified; go to the folder that runs/ lies in")
    with console.progress(len(folders), "verifying artifacts") as progress:
        for folder in folders:
            for node in lineage(folder, seen).all():
                above.add(node.place.absolute())
                if node.problem:
                    wrong.setdefault(node.place, node)
            progress.advance()
    problems = {place.as_posix(): "; ".join(filter(None, [node.problem, node.remedy])) for place, node in wrong.items()}
    ancestors = len(above - {folder.absolute() for folder in folders})
    document = {"artifacts": len(folders), "ancestors": ancestors, "problems": problems}
    if not wrong:
        more = f", and {several(ancestors, 'ancestor')} too" if ancestors else ""
        console.result(document, text=f"{len(folders)} of {len(folders)} artifacts are as they were made{more}")
        return 0
    if console.json:
        console.result({**document, "exit_code": 1})
        return 1
    whole = all(node.absent for node in wrong.values())
    first, *others = sorted(wrong.values(), key=lambda node: node.absent)
    for other in others:
        console.status(_describe(other))
    return console.error(_describe(first, "all that is here is whole" if whole else ""), 1, command="gsl verify")


def _describe(wrong: Ancestor, besides: str = "") -> str:
    """Return what is wrong and what to do."""
    return "; ".join(filter(None, [f"{wrong.place.as_posix()}: {wrong.problem}", besides, wrong.remedy]))


def draw_lineage(reference: str, console: Console) -> int:
    """Draw what an artifact was made from, and what is wrong with it; return 1 if something is.

    Raises:
        ArtifactError: There is no such artifact.
    """
    root = lineage(resolve_main(reference), {})
    console.draw(_tree(root))
    wrong = [node for node in root.all() if node.problem]
    console.result(_document(root) | ({"exit_code": 1} if wrong else {}))
    if wrong and not console.json:
        return console.error(_describe(wrong[0]), 1, command="gsl lineage")
    return int(bool(wrong))


def _tree(ancestor: Ancestor, tree: Tree | None = None) -> Tree:
    from rich.text import Text
    from rich.tree import Tree

    stored = ancestor.manifest
    label = Text(_in_a_line(f"{ancestor.role}: ") if ancestor.role else "")
    label.append(_in_a_line(ancestor.place.as_posix()), style="bold")
    if stored is not None:
        label.append(_in_a_line(f"  {stored.kind} {stored.contents[:SHORT]}"), style="dim")
    if ancestor.problem:
        label.append(_in_a_line(f"  {ancestor.problem}"), style="red")
    branch = Tree(label) if tree is None else tree.add(label)
    for parent in ancestor.parents:
        _tree(parent, branch)
    return branch


def _in_a_line(text: str) -> str:
    return visible(text.replace("\n", " "))


def _document(ancestor: Ancestor) -> dict[str, Any]:
    stored = ancestor.manifest
    return {
        "role": ancestor.role,
        "place": ancestor.place,
        "kind": None if stored is None else stored.kind,
        "contents": None if stored is None else stored.contents,
        "problem": ancestor.problem or None,
        "parents": [_document(parent) for parent in ancestor.parents],
    }
