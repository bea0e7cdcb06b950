"""What a source holds: the places of its episodes, the files that are read, and the mapping that reads them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from gsl.errors import ConfigError, InputError
from gsl.storage.importers.bag_table import TOPICS
from gsl.storage.importers.formats import is_bag
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.places import Place, places
from gsl.storage.lerobot.dataset import INFO, STATE, DataSet, find_data_set, is_data_set, open_data_set
from gsl.storage.lerobot.own_mapping import own_mapping

PLAIN = "position.{joint}"  # where positions are in files in our own words, and so in none of LeRobot's


class Source(NamedTuple):
    """A source that has been looked at.

    Attributes:
        places: Of its episodes, in order.
        mapping: What was asked for, or what a data set gives by itself.
        notes: What that takes for granted.
    """

    places: list[Place]
    mapping: LogMapping
    notes: list[str]


def look_at(source: str, mapping: LogMapping, memory: float) -> Source:
    """Return the episodes of a source and how to read them.

    Args:
        source: A file, a folder, a pattern, or the folder of a LeRobot data set.
        mapping: Asked for; one in our own words lets a data set speak for itself.
        memory: That reading may take [bytes].

    Raises:
        InputError: There is nothing, or what there is cannot be read.
    """
    folder = Path(source)
    if is_data_set(folder):
        if mapping.files is not None:
            what = "it" if mapping.signals["position"].column == PLAIN else "mapping="
            problem = f"{source} is a LeRobot data set, which says where its files are; leave {what} out"
            raise ConfigError("mapping.files", problem)
        data = open_data_set(folder, memory)
        notes: list[str] = []
        if mapping.signals["position"].column == PLAIN:
            mapping, notes = own_mapping(data, mapping, memory)
        else:
            _check_fitting(source, mapping, data)
        name = folder.resolve().name
        return Source(
            [Place(f"{name}/{episode.name}", {"": episode.file}, episode) for episode in data.episodes], mapping, notes
        )
    _check_plain(source, mapping)
    _check_bags(source, mapping)
    return Source(places(source, mapping.files, mapping.records), mapping, [])


def list_files(source: str, mapping: LogMapping, memory: float) -> Mapping[str, Path]:
    """Return the files that are read, by a name below the source."""
    folder = Path(source)
    if is_data_set(folder):
        return {path.relative_to(folder).as_posix(): path for path in open_data_set(folder, memory).files}
    _check_plain(source, mapping)
    paths = {
        f"{place.name}/{role}".rstrip("/"): path
        for place in places(source, mapping.files, mapping.records)
        for role, path in place.files.items()
    }
    return {
        name if file == path else f"{name}/{file.name}": file
        for name, path in paths.items()
        for file in ([path] if path.is_file() else sorted(file for file in path.iterdir() if file.is_file()))
    }


def _check_fitting(source: str, mapping: LogMapping, data: DataSet) -> None:
    """Refuse a mapping that is for another kind of log."""
    column = mapping.signals["position"].column
    columns = [str(name) for name in (column.values() if isinstance(column, dict) else [column])]
    if not any(name.startswith(tuple(data.widths)) for name in columns):
        problem = (
            f"is nothing of {source}, a LeRobot data set; it needs no mapping: leave mapping= out, or say {STATE}[0]"
        )
        raise ConfigError("mapping.signals.position.column", problem, given=columns[0])


def _check_plain(source: str, mapping: LogMapping) -> None:
    """Refuse what is said of LeRobot data sets where there is none, and a part or a folder of some in place of one."""
    for key in ("angles", "calibration"):
        if getattr(mapping, key) is not None:
            raise ConfigError(f"mapping.{key}", f"is for LeRobot data sets; {source} has no {INFO}")
    inside = find_data_set(Path(source) / "x")
    if inside is not None and mapping.signals["position"].column == PLAIN:
        raise InputError(f"source = {source}: is a part of a LeRobot data set; say source={_short(inside)}, its folder")
    if sets := sorted(info.parents[1] for info in Path(source).glob(f"*/{INFO}")):
        problem = (
            f"holds {len(sets)} LeRobot data sets; say one" if len(sets) > 1 else "holds a LeRobot data set; say it"
        )
        raise InputError(f"source = {source}: {problem}: source={sets[0]}")


def _check_bags(source: str, mapping: LogMapping) -> None:
    """Refuse bags whose topics nobody has named, among other files that are none of the log."""
    folder = Path(source)
    if mapping.files is not None or mapping.signals["position"].column != PLAIN or not folder.is_dir():
        return
    bags = sorted(path.name for path in folder.iterdir() if is_bag(path))
    if bags and not is_bag(folder):
        raise InputError(f"source = {source}: holds bags, such as {bags[0]}; {TOPICS}")


def _short(folder: Path) -> str:
    here = Path.cwd()
    return str(folder.relative_to(here)) if folder.is_relative_to(here) else str(folder)
