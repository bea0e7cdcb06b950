"""The command line: one line a stage, and nothing heavy until a command runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from gsl.commandline.elsewhere import import_elsewhere
from gsl.commandline.failure import INTERRUPTED, is_text, leave_quietly, report
from gsl.commandline.plugins import Commands, is_group
from gsl.commandline.run_commands import Reference, add_run_commands
from gsl.commandline.stage_command import (
    Cfg,
    ConfigDir,
    Json,
    Multirun,
    Overrides,
    StageCommand,
    add_stage,
    run_stage,
)
from gsl.commandline.streams import prepare_streams
from gsl.core.interruption import ignore, listen
from gsl.report.console import Console
from gsl.version import PACKAGE, __version__

QUIET = {"--quiet", "-q"}
NO_COMMAND = "No such command"  # how the usage error of typer begins

app = typer.Typer(
    cls=Commands,
    help="Grounded simulation learning: from a few real trajectories to a policy that works on the robot.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


add_stage(app, "collect", "Record trajectories of a policy in a world.")
add_stage(app, "train-forward", "Learn from real trajectories how the robot moves: the forward model.")
add_stage(app, "train-inverse", "Learn from simulated trajectories which action makes a motion: the inverse model.")
add_stage(
    app, "train-servo", "Learn from motions in the air what the robot's servos do: a law for the simulator's torques."
)
add_stage(app, "train-grounding", "Let a grounding of your own learn from trajectories.")
add_stage(app, "wiring", "Audit how a policy that gsl did not make is wired to a world: names, shapes, order, ranges.")
add_stage(app, "optimize", "Improve a policy in the simulator, grounded or not.")
add_stage(
    app, "audit", "Is it wiring? See in seconds whether a log and a simulator fit: names, signs, units, rows, rate."
)
add_stage(app, "diagnose", "Say where the simulator is wrong, which effect is missing, and how far the gap shrinks.")
add_stage(app, "identify", "Fit every parameter of the effect library at once: system identification, no verdict.")
add_stage(
    app, "cross-validate", "See whether what a diagnosis finds in a part of the trajectories is true of the rest."
)
add_stage(app, "evaluate", "Measure policies in the real world.")
add_stage(
    app, "export", "Write a simulator or trajectories for other tools: MJCF, Isaac Lab, bam, URDF, LeRobot, Minari."
)
add_stage(app, "survey", "See how far real worlds are from the simulator.")
add_stage(app, "answer", "Check logs and measured returns of a real robot, and take them in for a request.")
add_stage(app, "rehearse", "Let a simulated world answer a request as the real robot would.")
add_stage(app, "iterate", "The whole chain; with iterations=3 again, while the real return improves.")


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
    run_stage("import", arguments, multirun=multirun, cfg=cfg, config_dir=config_dir, json=json)


add_run_commands(app)


@app.command()
def verify(
    reference: Annotated[str | None, typer.Argument(metavar="[REF]", help="Path, or name of a run; or all.")] = None,
    json: Json = False,
) -> None:
    """Hash artifacts and all that they were made from again; exit 1 with the first thing that is wrong."""
    from gsl.commandline.lineage import verify

    raise typer.Exit(verify(reference, Console(json=json)))


@app.command()
def lineage(reference: Reference, json: Json = False) -> None:
    """Draw what an artifact was made from."""
    from gsl.commandline.lineage import draw_lineage

    raise typer.Exit(draw_lineage(reference, Console(json=json)))


_RERUN = "A new place, RUN_rerun by default; modules that are not gsl's and whose classes its settings may name."


@app.command()
def rerun(
    reference: Reference,
    settings: Annotated[list[str] | None, typer.Argument(metavar="[out=DIR] [trust=MODULE]", help=_RERUN)] = None,
    json: Json = False,
) -> None:
    """Repeat a run from its manifest into a new place and compare the payloads."""
    from gsl.commandline.rerun import rerun

    raise typer.Exit(rerun(reference, settings or [], Console(json=json)))


_RENDER = (
    "out=FILE: .gif, .mp4, or .png for a contact sheet; slow=2: half as fast; policy=NAME of a search; episode=0 and "
    "beside=REF of a log; seed= of the walk; trust=MODULE"
)


@app.command()
def render(
    reference: Reference,
    settings: Annotated[list[str] | None, typer.Argument(metavar="[out=film.gif]", help=_RENDER)] = None,
    json: Json = False,
) -> None:
    """Write a film of a log, or of the policy that a run returned, on the real side and in simulation."""
    from gsl.commandline.film import render

    render(reference, settings or [], Console(json=json))


@app.command()
def robot(
    name: Annotated[str, typer.Argument(help="Name of the robot, such as nao, its URDF, or robot_descriptions:NAME.")],
    out: Annotated[str, typer.Argument(metavar="[out=DIR]", help="Folder for the files.")] = "out=runs/robot",
    json: Json = False,
) -> None:
    """Write the robot's URDF and a picture of it standing."""
    from gsl.commandline.robot_files import write_robot

    write_robot(name, out, Console(json=json))


_INIT = (
    "also out=DIR, joints=A,B (controlled, in order), period= [s] of your logs, and effort= [N·m], velocity= [rad/s], "
    "lower= and upper= [rad] where the URDF says none"
)


@app.command()
def init(
    settings: Annotated[list[str] | None, typer.Argument(metavar="urdf=FILE name=NAME", help=_INIT)] = None,
    json: Json = False,
) -> None:
    """Write the configuration of your own robot from its URDF."""
    from gsl.commandline.init import write_configuration
    from gsl.core.configuration import list_worlds

    worlds = list_worlds()
    write_configuration(settings or [], worlds, Console(json=json))


@app.callback(invoke_without_command=True)
def root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", is_eager=True, help="Print the version.")] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Say only results, warnings and errors; after any command.")
    ] = False,
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
    prepare_streams()
    import_elsewhere()
    try:
        _leave_current_folder()
    except FileNotFoundError:
        code = Console().error("the current folder is gone; change into one that is there", 2)
    else:
        code = call(sys.argv[1:])
    ignore()
    try:
        sys.stdout.flush()
    except OSError:  # has been told; what is left in the buffer would be written, and fail, once more
        code = leave_quietly()
    exec("")  # else Python, if it was interrupted in a library's exec(), ends by the signal and not with our exit code
    sys.exit(code)


def _leave_current_folder() -> None:
    """Keep a file of the folder that a command is typed in from standing in for a library; own code needs trust."""
    here = os.path.realpath(os.getcwd())
    if here != os.path.realpath(PACKAGE.parent):  # gsl itself may be run from its repository
        sys.path[:] = [place for place in sys.path if os.path.realpath(place or here) != here]


def call(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code, with whatever went wrong told in a line."""
    Console.quiet = bool(QUIET.intersection(arguments))
    arguments = [word for word in arguments if word not in QUIET]
    console = Console(json="--json" in arguments)
    if any("\0" in word for word in arguments):
        return console.error("an argument holds a null character", 2)
    if word := next((word for word in arguments if not is_text(word)), ""):
        return console.error(f"an argument is no text in UTF-8: {word}; rename what it names", 2)
    try:
        code = int(app(args=list(arguments), prog_name="gsl", standalone_mode=False) or 0)
        return report(KeyboardInterrupt(), console, command=_command(arguments)) if code == INTERRUPTED else code
    except BrokenPipeError:
        return leave_quietly()
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except (Exception, KeyboardInterrupt) as failure:
        return _report_failure(failure, console, _command(arguments))


def _command(arguments: Sequence[str]) -> str:
    """Return the command that was typed, without its arguments."""
    words = [word for word in arguments if not word.startswith("-")]
    return " ".join(["gsl", *words[: 1 + (bool(words) and is_group(words[0]))]])


def _report_failure(failure: BaseException, console: Console, command: str) -> int:
    usage: Callable[[], str] | None = getattr(failure, "format_message", None)
    if usage is not None:
        line = " ".join(usage().split())
        more = " gsl --help lists them." if line.startswith(NO_COMMAND) and "Did you mean" not in line else ""
        return console.error(line + more, 2, command=command)
    return report(failure, console, command=command)
