"""Import foreign logs: CSV, JSON, npz, parquet or bags, by a mapping, as trajectories of the contract."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.interruption import checkpoint
from gsl.core.setting import component, setting
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, InputError, TrajectoryError
from gsl.report.importing import report, tables
from gsl.storage import documents
from gsl.storage.importers.assembly import Episode, episodes, list_unmatched
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.places import Place, locate
from gsl.storage.importers.reading import raw_episodes
from gsl.storage.importers.signal import KNOWN
from gsl.storage.importers.sizes import GB
from gsl.storage.importers.source import Source, list_files, look_at
from gsl.storage.trajectories import write

FILE = "trajectories.parquet"
REPORT = "import.json"
LARGE = 200e6  # bytes of a file whose reading is announced


@component
class Import:
    """Reads every episode that the mapping finds in the source; refuses what looks wrong unless `accept` is set."""

    kind: ClassVar[str] = "import"

    mapping: Annotated[LogMapping, setting("where each signal is, in which unit: a file in conf/mapping, or your own")]
    source: Annotated[str | None, setting("a file, a folder or a pattern; the mapping's own if null")] = None
    check: Annotated[bool, setting("write nothing, say what would be done; the same as --check")] = False
    accept: Annotated[bool, setting("take what looks swapped or in another unit as it is")] = False
    memory: Annotated[float, setting("that reading one file may take", unit="GB", gt=0)] = 2.0

    @property
    def only_looks(self) -> bool:
        """Whether nothing is to be written."""
        return self.check

    def parents(self) -> Mapping[str, Path]:
        """Return the files that are read."""
        files = list_files(self._source(), self.mapping, self.memory * GB)
        alone = len(files) == 1
        return {"source" if alone else f"source {name}": file for name, file in files.items()}

    @np.errstate(over="ignore", divide="ignore", invalid="ignore")  # of absurd values, which are refused in words
    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write one parquet file, and what was found as a document."""
        chosen = look_at(self._source(), self.mapping, self.memory * GB)
        imported = [
            episode
            for place in self._progress(chosen, console)
            for episode in self._episodes(place, chosen.mapping, console)
        ]
        document = self._describe(imported, chosen)
        if document["refused"] and not self.accept:
            more = f" (and {len(document['refused']) - 1} more, see --check)" if len(document["refused"]) > 1 else ""
            raise InputError(f"{self._source()}: {document['refused'][0]}{more}; accept=true takes it as it is")
        for kind, lines in (("note", document["notes"]), ("warning", [*document["refused"], *document["warnings"]])):
            for line in lines:
                console.status(f"{kind}: {line}")
        documents.write_json(folder / REPORT, document)
        write(folder / FILE, self._batch(imported, document, chosen.mapping))
        return {key: document[key] for key in ("files", "control_period", "time", "velocity", "warnings")} | {
            "episodes": len(imported),
            "robot": chosen.mapping.robot,
            "joints": list(imported[0].joints),
            "steps": sum(len(episode.trajectory) for episode in imported),
            "seconds": sum(float(episode.trajectory.time[-1]) for episode in imported),
        }

    @np.errstate(over="ignore", divide="ignore", invalid="ignore")  # of absurd values, which are refused in words
    def look(self, console: Console) -> dict[str, Any]:
        """Say what `run` would do, and return it with the exit code that it would have."""
        chosen = look_at(self._source(), self.mapping, self.memory * GB)
        imported, problems = list[Episode](), list[str]()
        for place in self._progress(chosen, console):
            try:
                imported += self._episodes(place, chosen.mapping, console)
            except ConfigError:
                raise
            except InputError as error:
                problems.append(str(error))
        empty = {"refused": [], "warnings": [], "notes": chosen.notes}
        document = self._describe(imported, chosen) if imported else empty
        for table in tables(document) if imported else ():
            console.table(*table)
        refused = [*problems, *([] if self.accept else document["refused"])]
        lines = [
            *(f"note: {line}" for line in document["notes"]),
            *(f"refused: {line}" for line in refused),
            *(f"warning: {line}" for line in document["warnings"]),
        ]
        if imported:
            lines += [
                f"{document['time']}; velocities {document['velocity']}; "
                f"control period {document['control_period']:g} s"
            ]
        lines += [f"would be refused ({len(refused)}); nothing is written" if refused else "nothing is written"]
        return {
            **document,
            "refused": refused,
            "source": self._source(),
            "said": "\n".join(lines),
            "exit_code": 2 * bool(refused),
        }

    def _source(self) -> str:
        if self.source:
            return locate(self.source)
        source = self.mapping.source
        if not source:
            raise ConfigError("source", "has no value yet; say source=... (a file, a folder or a pattern)")
        if Path(source).is_absolute() or ".." in Path(source).parts:
            raise ConfigError("mapping.source", "leads out of this folder; type source=... yourself", given=source)
        return locate(source)

    def _progress(self, chosen: Source, console: Console) -> Any:
        with console.progress(len(chosen.places), "reading logs") as progress:
            for place in chosen.places:
                yield place
                progress.advance()

    def _episodes(self, place: Place, mapping: LogMapping, console: Console) -> list[Episode]:
        for path in place.files.values():
            if path.is_file() and (size := path.stat().st_size) > LARGE:
                console.status(f"reading {path}, {size / GB:.2g} GB; with {self.memory:g} GB of memory at most")
        checkpoint()
        return [episode for raw in raw_episodes(place, mapping, self.memory * GB) for episode in episodes(raw, mapping)]

    def _describe(self, imported: list[Episode], chosen: Source) -> dict[str, Any]:
        first = imported[0]
        for episode in imported:
            if episode.joints != first.joints or episode.trajectory.sensors.keys() != first.trajectory.sensors.keys():
                problem = f"has other joints or signals than {first.label['file']}; import it alone"
                raise TrajectoryError(episode.label["file"], problem)
        files = len({path for place in chosen.places for path in place.files.values()})
        period = self.mapping.period
        kept = f"resampled to {period:g} s (positions linearly, commands held)" if period else "rows kept as logged"
        derived = sum(episode.derived for episode in imported)
        which = "" if derived in (0, len(imported)) else f" in {derived} of {len(imported)} episodes"
        velocity = f"derived from positions{which}" if derived else "as logged"
        sliding = chosen.mapping.list_sliding(first.joints)
        document = report(imported, files, period, self.mapping.turning, sliding)  # a data set says that of no joint
        remarks = dict.fromkeys(remark for episode in imported for remark in episode.remarks)
        warnings = [*remarks, *document["warnings"], *list_unmatched(imported, self.mapping)]
        return {**document, "warnings": warnings, "notes": chosen.notes, "time": kept, "velocity": velocity}

    def _batch(self, imported: list[Episode], document: Mapping[str, Any], mapping: LogMapping) -> Batch:
        own = {name: signal.unit for name, signal in mapping.signals.items() if name not in KNOWN}
        about = {
            "robot": mapping.robot,
            "role": "imported",
            "source": "gsl import",
            "units": own,
            "clocks": "synchronised" if self.mapping.synchronised else "unsynchronised",
            **{key: document[key] for key in ("time", "velocity")},
            **({"slides": slides} if (slides := mapping.list_sliding(imported[0].joints)) else {}),
            "episodes": [dict(episode.label) for episode in imported],
        }
        return Batch(
            tuple(episode.trajectory for episode in imported), imported[0].joints, document["control_period"], about
        )
