"""Rebuild the paper's tables and figures, ours beside them."""

from __future__ import annotations

import typer

from gsl.commandline.stage_command import add_stage
from gsl.report.console import Console

reproduce = typer.Typer(rich_markup_mode=None)

STUDIES = {
    "table2": "Groundings against each other on the walk, beside the paper's table 2.",
    "table2-paper": "The same by the paper's recipe to the letter.",
    "worlds": "The best groundings in worlds that took no part in their choice.",
    "servo": "A learned servo against noise, effects and no grounding, in five worlds.",
    "servos": "Published servo models of the SO-101 and the XL330 against ours, on real motions.",
    "bam": "The servo models of Rhoban/bam refitted by its own rules, one gain held out.",
    "motion": "Groundings where the real joints lag and are as stiff as the simulated ones.",
    "table3": "Three iterations with either of two simulators, beside the paper's table 3.",
    "table4": "Uneven ground, two grounding steps, beside the paper's table 4.",
    "linear-walk": "A linear policy learns to walk, beside the paper's section 6.3.",
    "fig5": "The arms' mean distance to their goal, as in the paper's figure 5.",
    "fig6": "A constant command on the real side, in simulation and grounded, as in the paper's figure 6.",
    "fig7": "An ankle of the linear walk, as in the paper's figure 7.",
    "fig11": "Cliff Walking against the noise of the real world, as in the paper's figure 11.",
    "fig12": "A heavy pendulum with noisy actions, as in the paper's figure 12 (gsl[mujoco,rl]).",
    "fig13": "A cheetah with noisy actions, as in the paper's figure 13 (gsl[mujoco,rl]).",
    "garat": "The heavier worlds of the GARAT suite (gsl[mujoco,rl]).",
    "budget": "Return and grounding error against the number of real trajectories.",
    "replays": "How grounded simulators move and yield beside the real world; nothing is searched.",
}

for name, summary in STUDIES.items():
    add_stage(reproduce, f"reproduce {name}", summary)


@reproduce.callback(invoke_without_command=True)
def paper(ctx: typer.Context) -> None:
    """Rebuild the paper's tables and figures, ours beside them."""
    if ctx.invoked_subcommand is None:
        Console().result({}, text=ctx.get_help())
