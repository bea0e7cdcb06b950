"""The commands that look at artifacts below runs/: list, compare, show, open, view, measure, clean up."""

from __future__ import annotations

from typing import Annotated

import typer

from gsl.commandline.stage_command import Json
from gsl.report.console import Console

Reference = Annotated[str, typer.Argument(metavar="REF", help="Path, or name of a run.")]


def add_run_commands(app: typer.Typer) -> None:
    """Add them to the command line."""
    for command in (runs, show, diff, metrics, view, clean):
        app.command()(command)
    app.command("open")(open_page)


_RUNS = (
    "kind=iterate, name= (part of it, or *), world=, metric='returned.value>20', newer=7d, older=2h; sort= made, "
    "took, name, kind or a metric, -NAME turns it round; limit=20: the first, without sort= the newest"
)


def runs(
    settings: Annotated[list[str] | None, typer.Argument(metavar="[kind=KIND] [sort=METRIC]", help=_RUNS)] = None,
    json: Json = False,
) -> None:
    """List the artifacts below runs/, oldest first, or by a metric."""
    from gsl.commandline.listing import list_runs

    list_runs(settings or [], Console(json=json))


def diff(first: Reference, second: Reference, json: Json = False) -> None:
    """Set two artifacts side by side: what differs of settings, parents, software and metrics."""
    from gsl.commandline.difference import compare

    compare(first, second, Console(json=json))


_METRICS = "tensorboard=DIR: a new folder for TensorBoard's event files"


def metrics(
    reference: Reference,
    settings: Annotated[list[str] | None, typer.Argument(metavar="[tensorboard=DIR]", help=_METRICS)] = None,
    json: Json = False,
) -> None:
    """Show the metrics of the generations and epochs of a run, or write them for TensorBoard."""
    from gsl.commandline.metrics import show_metrics

    show_metrics(reference, settings or [], Console(json=json))


_VIEW = (
    "out=FILE.rrd: a recording in place of a window; policy=NAME of a search; episode=0 and beside=REF of a log; "
    "seed= of the walk; trust=MODULE"
)


def view(
    reference: Reference,
    settings: Annotated[list[str] | None, typer.Argument(metavar="[out=FILE.rrd]", help=_VIEW)] = None,
    json: Json = False,
) -> None:
    """Scrub through a log or a walk: the robot, the ghost of the simulator, the curves of every joint."""
    from gsl.commandline.view import view

    view(reference, settings or [], Console(json=json))


_CLEAN = "name= (part of a path); stale=true, orphaned=true: artifacts made from one that was built anew, or is gone"


def clean(
    settings: Annotated[list[str] | None, typer.Argument(metavar="[stale=true] [name=NAME]", help=_CLEAN)] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Remove it.")] = False,
    json: Json = False,
) -> None:
    """Say what killed commands have left below runs/ and how large it is; remove it with --yes alone."""
    from gsl.commandline.clean import clean

    raise typer.Exit(clean(settings or [], Console(json=json), yes=yes))


def show(reference: Reference, json: Json = False) -> None:
    """Show how an artifact came about and what it holds."""
    from gsl.commandline.listing import show_artifact

    raise typer.Exit(show_artifact(reference, Console(json=json)))


def open_page(reference: Reference, json: Json = False) -> None:
    """Open the page of an artifact in a browser; without a display, say where it is."""
    from gsl.commandline.listing import open_artifact

    open_artifact(reference, Console(json=json))
