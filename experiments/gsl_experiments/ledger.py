"""What the trials of a study came to, written as each ends: a study goes on after a stop, or on another machine."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.setting import setting
from gsl.errors import ArtifactError, ConfigError
from gsl.storage.documents import text, write_json
from gsl.storage.hashing import file_hash, sources_hash
from gsl.storage.identity import WITHOUT_EFFECT, without
from gsl.storage.read_files import read_files
from gsl.storage.references import resolve
from gsl.storage.versions import commit
from gsl_experiments.effort import duration_told
from gsl_experiments.ledger_file import MADE_BY, RECIPE, Figures, check, read, write

DIGITS, SHORT = 12, 7  # of a recipe's hash, of a commit's
MADE = (
    "forward_model",
    "inverse_model",
    "diagnosis",
    "servo",
    "model",
)  # names of what a trial makes; a world's are files
NUMBER = ("number", "trial")  # what rows call their trial
# Settings that came after trials were written down, at what changes nothing.
LATER = {"race": 0.0, "covariance": "diagonal", "beta": 0.0, "aggregate": False, "choice": "sim", "rested": False,
         "multi_step": 1, "first": 1, "calibrated": True, "without": [],
         "objective": "mean", "quantile": 0.25, "servo": None, "motors": "servo",
         "servo_member": 0, "draws": False, "ensemble": False, "screening": 0}  # fmt: skip

GOES_ON = "goes on from the results that are there"  # what force=true does to a study
LABELS = ("preset_name",)  # that tables tell, and no result depends on

Known = Annotated[
    str | tuple[str, ...] | None,
    setting("trials that the same study has made before, not to be run again: a file or run, or a [list] of them"),
]


def recipe(*parts: Any) -> str:
    """Return the hash of a trial's settings and of the files that they name, such as a robot's.

    Neither settings on which no result depends nor gsl's sources are part of it: rows say who made them.
    """
    files = {name: file_hash(path) for name, path in read_files(list(parts)).items()}
    settings = text([without(describe(list(parts)), _idle), files])
    return hashlib.sha256(settings.encode()).hexdigest()[:DIGITS]


def list_earlier(earlier: str | tuple[str, ...] | None, name: str, role: str = "known") -> dict[str, Path]:
    """Return the files of earlier trials, or those of runs, as parents of the study.

    Args:
        earlier: As the user gave it.
        name: Of such a file in a study's artifact.
        role: Setting that the user gave.

    Raises:
        ArtifactError: There is none.
        ConfigError: It is an empty list.
    """
    if isinstance(earlier, str):
        return {role: _file(earlier, name)}
    if earlier == ():
        raise ConfigError(role, "is an empty list; leave it out")
    return {f"{role}.{index}": _file(reference, name) for index, reference in enumerate(earlier or ())}


def _file(reference: str, name: str) -> Path:
    place = resolve(reference) if Path(reference).suffix else resolve(reference, kind=("reproduce", "compare"))
    return place if place.is_file() else place / name


class Ledger:
    """The trials so far: figures by name, one or several rows a trial, each with the trial's recipe and who made it.

    The file only grows: trials of an earlier start stay until they are made anew.

    Raises:
        ArtifactError: A file of earlier trials holds something else, a trial twice, figures that cannot be or that
            another one tells otherwise, or is the one to be written.
    """

    def __init__(self, path: Path, earlier: Mapping[str, Path], kind: type[Figures], console: Console) -> None:
        self._path, self._console = path, console
        self._done: dict[str, list[dict[str, Any]]] = {}
        self._kind = kind
        self._kept = self._here()
        self._known: dict[str, list[dict[str, Any]]] = {}
        self._from: dict[Path, Set[str]] = {}
        for file in dict.fromkeys(earlier.values()):
            if path.exists() and file.samefile(path):
                raise ArtifactError(file, "is what this study writes; copy it, or give the study another name=")
            rows = read(file, kind)
            for key in rows.keys() & self._known.keys():
                if _figures(rows[key]) != _figures(self._known[key]):
                    problem = f"tells a trial (recipe {key}) otherwise than {self._whose(key)}"
                    raise ArtifactError(file, f"{problem}; leave one out")
            self._from[file] = rows.keys() - self._known.keys()
            self._known = {**rows, **self._known}
        self._me = _name_maker()

    @property
    def figures(self) -> list[dict[str, Any]]:
        """The rows of all trials so far, by trial, without recipe and maker."""
        return _figures(self._rows())

    def announce(self, wanted: Mapping[str, str], seconds: Callable[[], float] | None = None) -> float:
        """Say how many of a study's results are there, and how long the others will take; return that [s], or 0.

        Args:
            wanted: By recipe, whose results they are.
            seconds: Returns about how long all of them would take [s]; none if nobody knows.

        Raises:
            ArtifactError: A file of earlier trials that was given holds none of this study's.
        """
        there = wanted.keys() & self._known.keys()
        here = {key for key in wanted if self._rows_of(key)} - there
        if self._from and not there:
            problem = "holds no result of this study: its trials have other settings, seeds or files"
            raise ArtifactError(next(iter(self._from)), f"{problem}; without it the study runs them all")
        for place, keys in {**self._from, self._path: here}.items():
            if keys := wanted.keys() & keys:
                self._console.status(f"{len(keys)} of this study's {len(wanted)} results are in {place}")
        if others := sum(key in self._kept for key in wanted.keys() - there - here):
            problem = "are of another version of gsl and not taken; a copy of that file, given as known=, is"
            self._console.status(f"{others} of this study's {len(wanted)} results in {self._path} {problem}")
        missing = Counter(name for key, name in wanted.items() if key not in there | here)
        if not missing or seconds is None:
            return 0.0
        which = ", ".join(f"{name} ({count})" for name, count in missing.items())
        some = f"{missing.total()} of {len(wanted)} results, {which}"
        share = missing.total() / len(wanted)
        whose = some if share < 1.0 else "all of its results"
        rest = seconds() * share
        self._console.status(f"{duration_told(rest)} for {whose}; a study that was stopped goes on where it was")
        return rest

    def judge(self, wanted: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse trials that are there and say something else than their settings, before anything is written.

        Args:
            wanted: By recipe, what the rows have to say by field: the same in each, or in a list one for each row.

        Raises:
            ArtifactError: They say something else.
        """
        for key, of in wanted.items():
            rows = self._rows_of(key)
            for name, value in of.items() if rows else ():
                right = value if isinstance(value, list) else [value] * len(rows)
                if (said := [row[name] for row in rows]) != right:
                    problem = f"a trial whose settings (recipe {key}) say {name} {_spell(right)} says {_spell(said)}"
                    raise ArtifactError(self._whose(key), f"{problem}; leave it out")

    def take(self, key: str) -> bool:
        """Make a trial that is known, or was made here by this very version, one of this study; say whether it is.

        The file has it from the next trial that ends, or the study's end.
        """
        if rows := self._rows_of(key):
            self._done[key] = rows
        return bool(rows)

    def add(self, key: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write down a trial that has ended."""
        self._done[key] = [{**row, RECIPE: key, MADE_BY: self._me} for row in rows]
        self._write()

    def close(self, path: Path) -> str:
        """Write this study's trials to `path`; say what of the known ones is not among them, return who made which."""
        self._write()
        if unused := len(self._known.keys() - self._done.keys()):
            why = "are of other settings, methods or trials and were not used"
            self._console.status(f"{unused} of {len(self._known)} known trials {why}")
        write_json(path, self._rows())
        made = _list_makers(self._rows())
        if len(made) > 1:
            self._console.status(f"these trials were made by {len(made)} versions of gsl; the table says which")
        return " ".join(f"Made by {name}: {trials}." for name, trials in made.items())

    def _whose(self, key: str) -> Path:
        """Return the file that a trial stands in."""
        return next((file for file, keys in self._from.items() if key in keys), self._path)

    def _here(self) -> dict[str, list[dict[str, Any]]]:
        if not self._path.is_file():
            return {}
        check(self._path)
        return read(self._path, self._kind)

    def _rows_of(self, key: str) -> list[dict[str, Any]]:
        """Return the rows of a trial that is known, or that this version of gsl has made here."""
        return self._known.get(key) or [row for row in self._kept.get(key, []) if row[MADE_BY] == self._me]

    def _rows(self) -> list[dict[str, Any]]:
        return sorted((row for rows in self._done.values() for row in rows), key=_number)

    def _write(self) -> None:
        """Write this study's trials beside all others, and those that another study of this name wrote meanwhile."""
        self._kept = self._here()
        others = {other: made for other, made in {**self._known, **self._kept}.items() if other not in self._done}
        write(self._path, [*self._rows(), *(row for made in others.values() for row in made)])


def _figures(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name not in (RECIPE, MADE_BY)} for row in rows]


def _idle(name: str, value: Any) -> bool:
    """Return whether a trial does not depend on a component's setting."""
    made_here = name in MADE and isinstance(value, str)
    return made_here or name in (*WITHOUT_EFFECT, *LABELS) or (name in LATER and value == LATER[name])


def _spell(values: Sequence[Any]) -> str:
    return ", ".join(map(str, dict.fromkeys(values)))


def _number(row: Mapping[str, Any]) -> int:
    return int(next(row[name] for name in NUMBER if name in row))


def _list_makers(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return by maker which trials, with the methods of those that several have made."""
    trials_of: dict[str, dict[int, set[str]]] = {}
    for row in rows:
        trials_of.setdefault(row[MADE_BY], {}).setdefault(_number(row), set()).add(row.get("method", ""))
    makers = Counter(number for trials in trials_of.values() for number in trials)
    return {
        name: _spans({number: ", ".join(sorted(own)) if makers[number] > 1 else "" for number, own in trials.items()})
        for name, trials in trials_of.items()
    }


def _spans(trials: Mapping[int, str]) -> str:
    """Return the trials with what is said of each; those that follow each other with the same are told as one."""
    parts = []
    for (_, said), span in groupby(enumerate(sorted(trials)), lambda at: (at[1] - at[0], trials[at[1]])):
        numbers = [number for _, number in span]
        through = f" to {numbers[-1]}" if len(numbers) > 1 else ""
        parts.append(f"{numbers[0]}{through}{f' ({said})' if said else ''}")
    return f"trial{'s' * (len(trials) > 1)} {', '.join(parts)}"


def _name_maker() -> str:
    """Return the commit of gsl and the studies, or where their sources are of none, their hash."""
    made = commit()
    if made is None or made["dirty"]:
        return f"sources {sources_hash(Path(__file__).parent)[:SHORT]}"
    return str(made["commit"])[:SHORT]
