"""gsl from Python: the components, stages and artifacts of the command line, as functions and objects.

    import gsl

    world = gsl.make_world("nao_worn", effects={"ground_friction": {"friction": 0.6}})
    log = gsl.roll_out(world, episodes=3)
    found = gsl.run("iterate", name="mine", preset="toy", real="nao_weak")
    verdict = gsl.diagnose("air", "nao_ideal", name="air")

Names and settings are those of the command line (`gsl COMMAND --help`), and so are the checks and their messages.
"""

from gsl.api.components import make_grounding as make_grounding
from gsl.api.components import make_policy as make_policy
from gsl.api.components import make_task as make_task
from gsl.api.components import make_world as make_world
from gsl.api.files import read_trajectories as read_trajectories
from gsl.api.files import write_trajectories as write_trajectories
from gsl.api.results import Result as Result
from gsl.api.results import Verdict as Verdict
from gsl.api.rolling import roll_out as roll_out
from gsl.api.running import diagnose as diagnose
from gsl.api.running import run as run
from gsl.api.training_env import grounded_env as grounded_env
