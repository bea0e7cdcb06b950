"""What a stage has made, as an object that shows itself in a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gsl.core.budget import DOCUMENT_BYTES, read_text
from gsl.core.described import restore
from gsl.core.interfaces import World
from gsl.errors import ArtifactError
from gsl.grounding.diagnosis_file import read_diagnosis
from gsl.grounding.effects import switch_on
from gsl.report.account import account
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.diagnosis_report import report_of
from gsl.storage.hashing import PAGE
from gsl.storage.manifest import check_files

if TYPE_CHECKING:
    import pandas as pd

_FRAME = 'sandbox="allow-scripts" style="width: 100%; height: 600px; border: 0"'
"""A page may be a stranger's: its scripts do not reach the notebook around it, which can run code."""


@dataclass(frozen=True)
class Result:
    """What a stage has made; in a notebook it shows its tables.

    Attributes:
        artifact: Its folder and manifest.
        trust: Modules that are not gsl's and that its settings may name.
    """

    artifact: Artifact
    trust: tuple[str, ...] = ()

    @property
    def folder(self) -> Path:
        """Folder of the artifact, as seen from the current one where it lies below."""
        place = self.artifact.folder
        with suppress(OSError, ValueError):  # the current folder is gone, or another one
            return place.relative_to(Path.cwd())
        return place

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The figures that the stage reported.

        Raises:
            ArtifactError: Another artifact has taken its place (force=true).
        """
        return self._intact.metrics

    @property
    def page(self) -> Path | None:
        """Its page, to be opened in a browser; None of a stage that writes none."""
        return page if (page := self.folder / PAGE).is_file() else None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.folder.as_posix()})"

    def _repr_html_(self) -> str:
        return "".join(
            f"<p><b>{escape(part.title)}</b></p>{_table(part.columns, part.rows)}<p>{escape(part.caption or '')}</p>"
            for part in account(self._intact)
        )

    @property
    def _intact(self) -> Artifact:
        """The artifact, if no other one lies in its folder by now."""
        if manifest.read(self.folder).contents != self.artifact.manifest.contents:
            raise ArtifactError(
                self.folder, "was made anew since this result; run the stage again for what it holds now"
            )
        return self.artifact


@dataclass(frozen=True)
class Verdict(Result):
    """What a diagnosis says; in a notebook it shows its page."""

    @property
    def report(self) -> Mapping[str, Any]:
        """Everything that was found (docs/howto/diagnose.md)."""
        return report_of(self._intact.folder)

    @property
    def verdict(self) -> str:
        """One of `no_gap`, `causes`, `inseparable` and `unknown`."""
        return str(self.report["verdict"])

    @property
    def causes(self) -> list[str]:
        """Names of the effects that cause the gap."""
        return [cause["effect"] for cause in self.report["causes"]]

    @property
    def suspects(self) -> pd.DataFrame:
        """The causes, or the nearest effects if the verdict is `unknown`: a row for each parameter.

        Columns: effect, scope, parameter, value, low and high (95 % interval), unit (× of a factor), probability.
        """
        import pandas as pd  # takes a quarter of a second, and few ask

        report, columns = self.report, ("value", "low", "high", "unit")
        rows = [
            (cause["effect"], cause["scope"], name, *(values.get(key) for key in columns), cause.get("probability"))
            for cause in report["causes"] or report["suspects"]
            for name, values in (cause["parameters"] or {"": {}}).items()
        ]
        return pd.DataFrame(rows, columns=["effect", "scope", "parameter", *columns, "probability"])

    @property
    def effects(self) -> Mapping[str, Any]:
        """What the simulator lacks, as in a world's `effects:`."""
        return dict(self.report["effects"])

    @property
    def world(self) -> World:
        """The simulator with what it lacks."""
        sim = restore(self.artifact.config["sim"], trust=self.trust, where="sim")
        return switch_on(sim, read_diagnosis(str(self.folder), "diagnose"))

    @property
    def summary(self) -> str:
        """The same in a sentence or two."""
        return str(self.report["summary"])

    def __str__(self) -> str:
        return f"{self.verdict}: {self.summary}"

    def _repr_html_(self) -> str:
        check_files(self.folder, self.artifact.manifest, (PAGE,))
        page = read_text(self.folder / PAGE, DOCUMENT_BYTES)
        return f'<iframe srcdoc="{escape(page)}" {_FRAME}></iframe>'


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [(columns, "th"), *((row, "td") for row in rows)]
    cells = ["".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in line) for line, tag in lines]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in cells) + "</table>"
