"""A rehearsal of a request: a surrogate plays the robot's part at the other end of the very same files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import gymnasium
import numpy as np

from gsl.core.budget import holds
from gsl.core.console import Console, Progress
from gsl.core.interfaces import World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ArtifactError, ConfigError, GslError
from gsl.real_robot.errand import REHEARSAL
from gsl.runner import bridge
from gsl.runner.journal import ANSWER, RETURNS, add_return, ends
from gsl.runner.request import HELD, NAME, read_request
from gsl.runner.senses import BODY, JOINTS
from gsl.storage.requests import MODULES, files_of

CACHE = "__pycache__"  # of a folder in which a runner was started; nothing in it is read
_BODY = ("base.position", "base.orientation", "base.velocity")


@component
class Rehearse:
    """Starts the request's runner as the robot's computer would, with a robot.py whose robot is a simulated world.

    What the surrogate sees of its base goes into the log, unless a tape measure is to be rehearsed as well.
    """

    kind: ClassVar[str] = REHEARSAL

    request: Annotated[str, setting("folder of the request", min_length=1)]
    world: Annotated[World, setting("what plays the robot's part")]
    tape: Annotated[bool, setting("measure distances with a tape: nothing of the base is logged")] = False
    episodes: Annotated[tuple[str, ...], setting("names of the episodes of this sitting; none for all")] = ()
    trust: Annotated[tuple[str, ...], setting("modules of your own whose policy the request may name")] = ()

    def parents(self) -> Mapping[str, Path]:
        """Return the request."""
        return {"request": Path(self.request) / NAME} if (Path(self.request) / NAME).is_file() else {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the answer."""
        place = Path(self.request)
        request = read_request(place, self.trust)
        _check_runner(place, request)
        layout = self.world.layout
        if list(layout.joints) != request["joints"] or layout.control_period != request["control_period"]:
            raise ConfigError("world", f"is no stand-in for {request['robot']}: it has other joints or another rate")
        if getattr(self.world, "floating", True) == (request["place"] == HELD):
            raise ConfigError("world.floating", f"the request is for a robot {request['place']}")
        env = self.world.make()
        try:
            surrogate = Surrogate(request, env, layout, blind=self.tape)
            with console.progress(len(request["episodes"]), "rehearsing") as progress:
                surrogate.serve(place, folder / ANSWER, self.episodes, self.trust, progress)
        finally:
            env.close()
        if self.tape and request["distance"]:
            for name, (distance, fell) in surrogate.measured.items():
                add_return(folder / RETURNS, request["hash"], name, repr(distance), fell=fell)
        done = ends(folder / ANSWER)
        return {"episodes": len(done), "asked": len(request["episodes"]), "falls": sum(done.values())}


class Surrogate:
    """Answers the runner's `read`, `send` and `begin` with an environment; outside of an episode it obeys perfectly."""

    def __init__(self, request: Mapping[str, Any], env: gymnasium.Env, layout: Layout, *, blind: bool) -> None:
        self._env, self._layout = env, layout
        taken = {*request["observes"], *BODY, *JOINTS} - ({*_BODY} if blind else set())
        self._parts = {part: layout[part] for part in layout.sizes if part in taken}
        self._sizes = request["observes"]
        self._observation = np.zeros(layout.size)
        self._observation[layout["position"]] = request["episodes"][0]["posture"]
        self._acting, self._fell, self._name = False, False, ""
        self.measured: dict[str, tuple[float, bool]] = {}

    def serve(self, folder: Path, log: Path, episodes: Sequence[str], trust: Sequence[str], progress: Progress) -> None:
        """Run the runner of a folder until it ends.

        Raises:
            GslError: It ended with an error.
        """
        (to_us, from_runner), (to_runner, from_us) = os.pipe(), os.pipe()
        compiled = f"pycache_prefix={log.with_name('.compiled').resolve()}"  # not what is compiled in its folder
        runner = str((folder / "runner.py").resolve())
        words = [sys.executable, "-I", "-B", "-X", compiled, runner, f"--robot={bridge.__file__}"]
        words += [f"--log={log.resolve()}", "--yes", "--unpaced", *(f"--episode={name}" for name in episodes)]
        words += [f"--trust={module}" for module in trust]
        environment = {**os.environ, bridge.PIPES: f"{to_runner},{from_runner}"}
        with (
            tempfile.TemporaryFile() as said,  # a pipe that nobody empties would stop the runner
            subprocess.Popen(
                words, env=environment, pass_fds=(to_runner, from_runner), stdout=said, stderr=subprocess.STDOUT
            ) as process,
        ):
            os.close(to_runner)
            os.close(from_runner)
            with os.fdopen(to_us, encoding="utf-8") as requests, os.fdopen(from_us, "w", encoding="utf-8") as answers:
                for line in requests:
                    answers.write(json.dumps(self._answer(json.loads(line), progress)) + "\n")
                    answers.flush()
            process.wait()
            said.seek(0)
            last = said.read().decode(errors="replace").strip().rpartition("\n")[2]
        if process.returncode:
            raise GslError(f"the runner ended with exit code {process.returncode}: {last}")

    def _answer(self, call: Mapping[str, Any], progress: Progress) -> Any:
        match call["do"]:
            case "begin":
                episode = call["episode"]
                self._begin(episode, progress)
            case "send":
                self._send(np.array(call["targets"]))
            case "end":  # if it lies, somebody sets it up
                self._acting = self._fell = False
            case "read":
                return self._read()
        return None

    def _begin(self, episode: Mapping[str, Any], progress: Progress) -> None:
        posture = np.array(episode["posture"])
        self._observation, _ = self._env.reset(seed=episode["seed"], options={"posture": posture})
        self._start, self._left, self._name = self._observation, episode["steps"], episode["name"]
        self._acting, self._fell = True, False
        progress.advance()

    def _send(self, targets: np.ndarray) -> None:
        if not self._acting:
            self._observation = self._observation.copy()
            self._observation[self._layout["position"]] = targets
            return
        self._observation, _, self._fell, _, _ = self._env.step(targets)
        self._left -= 1
        if "base.position" in self._layout.sizes:
            forward = self._layout["base.position"].start
            way = float(self._observation[forward] - self._start[forward])
            self.measured[self._name] = way, bool(self._fell)
        self._acting = self._left > 0 and not self._fell

    def _read(self) -> dict[str, Any]:
        reading = {part: self._observation[place].tolist() for part, place in self._parts.items()}
        return {**reading, "fell": bool(self._fell)}


def _check_runner(folder: Path, request: Mapping[str, Any]) -> None:
    """Refuse to run what gsl did not write, and modules beside its own, which would stand in for a library."""
    files = files_of(request)
    for path in sorted((folder / MODULES).rglob("*")):
        ours = path.is_dir() and not path.is_symlink() or path.relative_to(folder).as_posix() in files
        if not ours and path.parent.name != CACHE:
            raise ArtifactError(path, "is none of gsl's modules, and is not run here; take it away")
    for name, content in files.items():
        path = folder / name
        if not holds(path, content):
            raise ArtifactError(path, "is not what this gsl writes, and is not run here; make the request anew")
