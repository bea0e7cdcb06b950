"""The command line: one line a stage, and nothing heavy until a command runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from gsl.commandline.completion import CONFIG_DIR, complete, name_of, user_folder
from gsl.commandline.failure import INTERRUPTED, leave_quietly, report
from gsl.core.interruption import ignore, listen
from gsl.report.console import Console
from gsl.version import __version__

TYPED = "gsl.typed"


class StageCommand(TyperCommand):
    """A command whose help ends with the groups and settings of its configuration, as it is typed."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Keep what is typed for the help, which is asked for before arguments are read."""
        ctx.meta[TYPED] = [one for one in args if "=" in one and not one.startswith("-")]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write usage and options, then what can be set."""
        from gsl.commandline.help import write_help

        super().format_help(ctx, formatter)
        formatter.write(write_help(name_of(ctx), ctx.meta.get(TYPED, []), config_dir=user_folder(ctx)))


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

app = typer.Typer(
    help="Grounded simulation learning: from a few real trajectories to a policy that works on the robot.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


blind, reproduce = typer.Typer(rich_markup_mode=None), typer.Typer(rich_markup_mode=None)
app.add_typer(blind, name="blind")
app.add_typer(reproduce, name="reproduce")
GROUPS = {"blind": blind, "reproduce": reproduce}


def stage(name: str, summary: str) -> None:
    """Add the command of a stage, whose settings are in the yaml file of the same name; two words are in a group."""
    group, _, word = name.rpartition(" ")

    @GROUPS.get(group, app).command(word, cls=StageCommand, help=summary, short_help=summary)
    def command(
        overrides: Overrides = None,
        multirun: Multirun = False,
        cfg: Cfg = None,
        config_dir: ConfigDir = None,
        json: Json = False,
    ) -> None:
        _run(name, overrides or [], multirun=multirun, cfg=cfg, config_dir=config_dir, json=json)


def _run(
    name: str, overrides: list[str], *, multirun: bool, cfg: Shown | None, config_dir: Path | None, json: bool
) -> None:
    from gsl.commandline.run import run

    show = cfg is not None
    code = run(name, overrides, multirun=multirun, cfg=show, config_dir=config_dir, json=json)
    raise typer.Exit(code)


stage("collect", "Record trajectories of a policy in a world.")
stage("train-forward", "Learn from real trajectories how the robot moves: the forward model.")
stage("train-inverse", "Learn from simulated trajectories which action makes a motion: the inverse model.")
stage("train-servo", "Learn from motions in the air what the robot's servos do: a law for the simulator's torques.")
stage("train-grounding", "Let a grounding of your own learn from trajectories.")
stage("optimize", "Improve a policy in the simulator, grounded or not.")
stage("diagnose", "Say where the simulator is wrong, which effect is missing, and how far the gap shrinks.")
stage("identify", "Fit every parameter of the effect library at once: system identification, no verdict.")
stage("cross-validate", "See whether what a diagnosis finds in a part of the trajectories is true of the rest.")
stage("blind make", "Draw robots with known causes, log what they do, and seal the labels.")
stage("blind answer", "Diagnose every case without its label, and seal the answers.")
stage("blind reveal", "Check the seals, set the answers against the labels, and count.")
stage("evaluate", "Measure policies in the real world.")
stage("compare", "Set groundings against each other over paired trials.")
stage("reproduce table2", "Groundings against each other on the walk, beside the paper's table 2.")
stage("reproduce table2-paper", "The same by the paper's recipe to the letter.")
stage("reproduce worlds", "The best groundings in worlds that took no part in their choice.")
stage("reproduce servo", "A learned servo against noise, effects and no grounding, in five worlds.")
stage("reproduce motion", "Groundings where the real joints lag and are as stiff as the simulated ones.")
stage("reproduce table3", "Three iterations with either of two simulators, beside the paper's table 3.")
stage("reproduce table4", "Uneven ground, two grounding steps, beside the paper's table 4.")
stage("reproduce linear-walk", "A linear policy learns to walk, beside the paper's section 6.3.")
stage("reproduce fig5", "The arms' mean distance to their goal, as in the paper's figure 5.")
stage("reproduce fig6", "A constant command in real, in simulation and grounded, as in the paper's figure 6.")
stage("reproduce fig7", "An ankle of the linear walk, as in the paper's figure 7.")
stage("reproduce fig11", "Cliff Walking against the noise of the real world, as in the paper's figure 11.")
stage("reproduce fig12", "A heavy pendulum with noisy actions, as in the paper's figure 12 (gsl[mujoco,rl]).")
stage("reproduce fig13", "A cheetah with noisy actions, as in the paper's figure 13 (gsl[mujoco,rl]).")
stage("reproduce garat", "The heavier worlds of the GARAT suite (gsl[mujoco,rl]).")
stage("reproduce budget", "Return and grounding error against the number of real trajectories.")
stage("reproduce replays", "How grounded simulators move and yield beside the real world; nothing is searched.")
stage("survey", "See how far real worlds are from the simulator.")
stage("answer", "Check logs and measured returns of a real robot, and take them in for a request.")
stage("rehearse", "Let a simulated world answer a request as the real robot would.")
stage("iterate", "The whole chain, again and again, until the real return stops improving.")


IMPORT = "Bring logs of a real robot: CSV, JSON, npz, parquet or bags, by a small mapping."


@app.command("import", cls=StageCommand, help=IMPORT, short_help=IMPORT)
def import_logs(
    overrides: Overrides = None,
    check: Annotated[bool, typer.Option("--check", help="Write nothing, say what would be done.")] = False,
    multirun: Multirun = False,
    cfg: Cfg = None,
    config_dir: ConfigDir = None,
    json: Json = False,
) -> None:
    """Import is a stage with one option more."""
    arguments = [*(overrides or []), *(["check=true"] if check else [])]
    _run("import", arguments, multirun=multirun, cfg=cfg, config_dir=config_dir, json=json)


@app.command()
def runs(json: Json = False) -> None:
    """List the artifacts below runs/, oldest first."""
    from gsl.commandline.listing import list_runs

    list_runs(Console(json=json))


@app.command()
def show(
    reference: Annotated[str, typer.Argument(metavar="REF", help="Path, or name of a run.")], json: Json = False
) -> None:
    """Show how an artifact came about and what it holds."""
    from gsl.commandline.listing import show_artifact

    show_artifact(reference, Console(json=json))


@app.command()
def robot(
    name: Annotated[str, typer.Argument(help="Name of the robot, such as nao, or its URDF.")],
    out: Annotated[str, typer.Argument(metavar="[out=DIR]", help="Folder for the files.")] = "out=runs/robot",
    json: Json = False,
) -> None:
    """Write the robot's URDF and a picture of it standing."""
    from gsl.commandline.robot_files import write_robot

    write_robot(name, Path(out.removeprefix("out=")), Console(json=json))


_INIT = "also out=DIR, joints=A,B (controlled, in order), effort= [N·m] and velocity= [rad/s] over the URDF's"


@app.command()
def init(
    settings: Annotated[list[str] | None, typer.Argument(metavar="urdf=FILE name=NAME", help=_INIT)] = None,
    json: Json = False,
) -> None:
    """Write the configuration of your own robot from its URDF."""
    from gsl.commandline.composer import configuration_folder
    from gsl.commandline.init import write_configuration

    worlds = [path.stem for path in (configuration_folder() / "world").glob("*.yaml")]
    write_configuration(settings or [], worlds, Console(json=json))


@app.command()
def bench(json: Json = False) -> None:
    """Measure what a step costs, as ratios of CPU time."""
    from gsl.benchmarks.bench import run_bench

    run_bench(Console(json=json))


@blind.callback(invoke_without_command=True)
def benchmark(ctx: typer.Context) -> None:
    """Measure the diagnosis on robots of known but sealed causes."""
    if ctx.invoked_subcommand is None:
        Console().result({}, text=ctx.get_help())


@reproduce.callback(invoke_without_command=True)
def paper(ctx: typer.Context) -> None:
    """Rebuild the paper's tables and figures, ours beside them."""
    if ctx.invoked_subcommand is None:
        Console().result({}, text=ctx.get_help())


@app.callback(invoke_without_command=True)
def root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", is_eager=True, help="Print the version.")] = False,
) -> None:
    """Grounded simulation learning: from a few real trajectories to a policy that works on the robot."""
    if version:
        Console().result({}, text=__version__)
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        Console().result({}, text=ctx.get_help())


def main() -> None:
    """Run the command line of this process."""
    listen()
    sys.path.append(os.getcwd())
    code = call(sys.argv[1:])
    ignore()
    exec("")  # else Python, if it was interrupted in a library's exec(), ends by the signal and not with our exit code
    sys.exit(code)


def call(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code, with whatever went wrong told in a line."""
    words = [word for word in arguments if not word.startswith("-")]
    command = " ".join(["gsl", *words[: 1 + (bool(words) and words[0] in GROUPS)]])
    console = Console(json="--json" in arguments)
    try:
        code = int(app(args=list(arguments), prog_name="gsl", standalone_mode=False) or 0)
        return report(KeyboardInterrupt(), console, command=command) if code == INTERRUPTED else code
    except BrokenPipeError:
        return leave_quietly()
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except (Exception, KeyboardInterrupt) as failure:
        return _told(failure, console, command)


def _told(failure: BaseException, console: Console, command: str) -> int:
    usage: Callable[[], str] | None = getattr(failure, "format_message", None)
    if usage is not None:
        return console.error(" ".join(usage().split()), 2, command=command)
    return report(failure, console, command=command)
