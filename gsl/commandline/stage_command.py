"""The command of a stage: its arguments are settings, and its help ends with what can be set."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from gsl.commandline.completion import CONFIG_DIR, complete, name_of, user_folder
from gsl.core.visible import visible
from gsl.report.console import Console

TYPED = "gsl.typed"


class StageCommand(TyperCommand):
    """A command whose help ends with the groups and settings of its configuration, as it is typed."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Keep what is typed for the help, which is asked for before arguments are read."""
        ctx.meta[TYPED] = [word for word in args if "=" in word and not word.startswith("-")]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write usage and options, then what can be set."""
        from gsl.commandline.help_cache import read_or_write

        super().format_help(ctx, formatter)
        command, typed, folder = name_of(ctx), ctx.meta.get(TYPED, []), user_folder(ctx)

        def write() -> str:
            from gsl.commandline.help import write_help

            return write_help(command, typed, config_dir=folder)

        formatter.write(visible(write() if folder else read_or_write(command, typed, write)))


class Shown(StrEnum):
    """What --cfg prints."""

    JOB = "job"


Overrides = Annotated[
    list[str] | None,
    typer.Argument(metavar="KEY=VALUE", help="Choices and settings, see below.", autocompletion=complete),
]
Multirun = Annotated[
    bool, typer.Option("--multirun", "-m", help="Keys with several values (seed=1,2,3) make several jobs.")
]
Cfg = Annotated[Shown | None, typer.Option("--cfg", "-c", help="Print the composed configuration and do nothing.")]
ConfigDir = Annotated[
    Path | None,
    typer.Option(envvar=CONFIG_DIR, is_eager=True, help="Folder of your own yaml files; they win over ours."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]


def add_stage(app: typer.Typer, name: str, summary: str) -> None:
    """Add the command of a stage, whose settings are in the yaml file of the same name.

    Args:
        app: The group, or all of gsl.
        name: Its words as they are typed after gsl; the last one is its name in the group.
        summary: A sentence for the help.
    """

    @app.command(name.rpartition(" ")[2], cls=StageCommand, help=summary, short_help=summary)
    def command(
        overrides: Overrides = None,
        multirun: Multirun = False,
        cfg: Cfg = None,
        config_dir: ConfigDir = None,
        json: Json = False,
    ) -> None:
        run_stage(name, overrides or [], multirun=multirun, cfg=cfg, config_dir=config_dir, json=json)


def run_stage(
    name: str, overrides: list[str], *, multirun: bool, cfg: Shown | None, config_dir: Path | None, json: bool
) -> None:
    """Run the command of a stage and end with its exit code."""
    with Console(json=json).at_work(f"gsl {name} starts"):
        from gsl.commandline.run import run

    show = cfg is not None
    code = run(name, overrides, multirun=multirun, cfg=show, config_dir=config_dir, json=json)
    raise typer.Exit(code)
