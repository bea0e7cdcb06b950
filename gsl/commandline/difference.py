"""`gsl diff`: two artifacts side by side, what differs of settings, parents, versions, metrics and diagnosed causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gsl.core.setting import REQUIRED, settings_of
from gsl.core.trust import TARGET, class_of, is_ours
from gsl.core.unit import Unit
from gsl.errors import ArtifactError, ConfigError
from gsl.report.account import plain
from gsl.report.console import Console
from gsl.report.diagnosis_two import set_side_by_side, table_of_two
from gsl.report.diagnosis_verdict import verdict
from gsl.report.headline import show_in_unit, unit_of
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.diagnosis_report import REPORT, report_of
from gsl.storage.documents import plain as plain_types
from gsl.storage.hashing import SHORT
from gsl.storage.identity import flat
from gsl.storage.references import name_run, resolve_main

Pair = tuple[Any, Any]
ABSENT = "-"
NO_SETTING = "not a setting"


def compare(first: str, second: str, console: Console) -> None:
    """Show what differs between two artifacts, or say that nothing does.

    Args:
        first: A path, or the name of a run; of a whole run, its `iterate` is meant.
        second: The other.
        console: Where they are set side by side.

    Raises:
        ArtifactError: There is no such artifact, or it is damaged.
    """
    left, right = (Artifact(folder, manifest.read(folder)) for folder in map(resolve_main, (first, second)))
    for artifact in (left, right):
        manifest.check_intact(artifact.folder, artifact.manifest)
    made = left.manifest, right.manifest
    parents = [{parent.role: parent.hash[:SHORT] for parent in each.parents} for each in made]
    roles = parents[0].keys() & parents[1].keys()  # where such a parent lies is told by its contents
    configs = [{key: value for key, value in flat(each.config).items() if key not in roles} for each in (left, right)]
    settings = [
        {**own, **_find_defaults(each.config, other.keys() - own.keys())}
        for each, own, other in zip((left, right), configs, reversed(configs), strict=True)
    ]
    software = [{**each.versions, "sources of gsl": each.sources[:SHORT], "kind": each.kind} for each in made]
    parts = {
        "settings": _differ(*settings),
        "made from": _differ(*parents),
        "software": _differ(*software),
        "metrics": _differ(flat(left.metrics), flat(right.metrics)),
    }
    names = [name_run(each.folder) for each in (left, right)]
    unit = unit_of(left) if unit_of(left) == unit_of(right) else Unit()  # of different tasks each is as it was measured
    shown = _differ(*(show_in_unit(flat(each.metrics), unit) for each in (left, right)))
    for title, pairs in {**parts, "metrics": shown}.items():
        if pairs:
            rows = [
                (name, *_show(pair), *([_change(pair)] if title == "metrics" else [])) for name, pair in pairs.items()
            ]
            columns = [title, *names, *(["change"] if title == "metrics" else [])]
            console.table(f"{title}: {len(rows)} {'differ' if len(rows) > 1 else 'differs'}", columns, rows)
    causes = _compare_diagnoses((left, right), (names[0], names[1]), console)
    same = not any(parts.values()) and all(row["alike"] for row in causes)
    document = {**({"causes": causes} if causes else {}), "folders": [left.folder, right.folder], "same": same}
    text = f"{names[0]} and {names[1]}: the same settings, parents, software and metrics" if same else ""
    console.result({**document, **{title.replace(" ", "_"): pairs for title, pairs in parts.items()}}, text=text)


def _compare_diagnoses(artifacts: tuple[Artifact, Artifact], names: Pair, console: Console) -> list[dict[str, Any]]:
    """Show the causes of two diagnoses side by side; nothing of other artifacts."""
    if any(artifact.manifest.kind != "diagnose" for artifact in artifacts):
        return []
    reports = _read_report(artifacts[0].folder), _read_report(artifacts[1].folder)
    rows = set_side_by_side(*reports)
    console.table(*table_of_two(rows, (verdict(reports[0]), verdict(reports[1])), names))
    return rows


def _read_report(folder: Path) -> dict[str, Any]:
    try:
        return report_of(folder)
    except (OSError, ValueError) as error:
        raise ArtifactError(folder / REPORT, "is damaged; diagnose again with force=true") from error


def _find_defaults(config: Mapping[str, Any], absent: Iterable[str]) -> dict[str, Any]:
    """Return what settings are that a configuration does not name: the default, or that its class has none."""
    values = {}
    for name in absent:
        parent, _, last = name.rpartition(".")
        node: Any = config
        for key in filter(None, parent.split(".")):
            node = node.get(key) if isinstance(node, Mapping) else None
        target = node.get(TARGET) if isinstance(node, Mapping) else None
        if not isinstance(target, str) or not is_ours(target):  # nothing of others' is imported to compare
            continue
        try:
            declared = settings_of(class_of(target))
        except (ConfigError, ValueError, TypeError, AttributeError):  # of another version
            continue
        if last not in declared:
            values[name] = NO_SETTING
        elif declared[last].default is not REQUIRED:
            values[name] = plain_types(declared[last].default)
    return values


def _differ(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Pair]:
    names = [*before, *(name for name in after if name not in before)]
    return {name: (before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)}


def _show(pair: Pair) -> tuple[str, str]:
    """Return both values in few digits, in all of them where few are alike."""
    shown = [ABSENT if value is None else plain(value) for value in pair]
    if shown[0] == shown[1]:
        shown = [repr(value) for value in pair]
    return shown[0], shown[1]


def _change(pair: Pair) -> str:
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in pair)
    return f"{pair[1] - pair[0]:+.4g}" if numbers else ""
