"""Measure the diagnosis on robots of known but sealed causes."""

from __future__ import annotations

import typer

from gsl.commandline.stage_command import Json, add_stage
from gsl.report.console import Console

blind = typer.Typer(rich_markup_mode=None)
add_stage(blind, "blind make", "Draw robots with known causes, log what they do, and seal the labels.")
add_stage(blind, "blind answer", "Diagnose every case without its label, and seal the answers.")
add_stage(blind, "blind reveal", "Check the seals, set the answers against the labels, and count.")
add_stage(blind, "blind wiring", "Audit robots with sealed wiring faults and robots with physics alone, and count.")


@blind.callback(invoke_without_command=True)
def benchmark(ctx: typer.Context) -> None:
    """Measure the diagnosis on robots of known but sealed causes."""
    if ctx.invoked_subcommand is None:
        Console().result({}, text=ctx.get_help())


def bench(json: Json = False) -> None:
    """Measure what a step costs, as ratios of CPU time."""
    from gsl_benchmarks.bench import run_bench

    run_bench(Console(json=json))
