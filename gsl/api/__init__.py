"""gsl from Python: the components, stages and artifacts of the command line, as functions and objects.

    import gsl

    world = gsl.make_world("nao_worn", effects={"ground_friction": {"friction": 0.6}})
    log = gsl.roll_out(world, episodes=3)
    found = gsl.run("iterate", name="mine", preset="toy", real="nao_weak")
    verdict = gsl.diagnose("air", "nao_ideal", name="air")

Names and settings are those of the command line (`gsl COMMAND --help`), and so are the checks and their messages.
"""

from gsl.api.components import make_grounding, make_policy, make_task, make_world
from gsl.api.files import read_trajectories, write_trajectories
from gsl.api.results import Result, Verdict
from gsl.api.rolling import roll_out
from gsl.api.running import diagnose, run

__all__ = [
    "Result",
    "Verdict",
    "diagnose",
    "make_grounding",
    "make_policy",
    "make_task",
    "make_world",
    "read_trajectories",
    "roll_out",
    "run",
    "write_trajectories",
]
