"""The runner beside a robot acts as gsl's policies do, to the bit, with numpy alone, and sends nothing unsafe."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf
from robots_elsewhere import requested, run

from gsl.core.described import describe, restore
from gsl.core.interfaces import Policy
from gsl.core.seeds import grounding_generator
from gsl.errors import ArtifactError, ConfigError, GslError
from gsl.grounding.ane import ActionNoise
from gsl.policies.excitation import Excitation
from gsl.policies.policy import neighbour
from gsl.policies.walk_engine import WalkEngine
from gsl.runner import journal, preflight
from gsl.runner.acting import Actor
from gsl.runner.clock import Simulated
from gsl.runner.episode import Player
from gsl.runner.following import Following
from gsl.runner.guard import Guard, ramp
from gsl.runner.request import due, layout_of, read_request
from gsl.runner.robots import PerfectRobot
from gsl.runner.senses import RobotError
from gsl.storage.bundle import bundle
from gsl.tasks.excite import Excite
from gsl.tasks.walk import Walk
from gsl.worlds.external import ExternalRobot

pytestmark = pytest.mark.slow

CONF = Path(__file__).parents[2] / "conf"
EXAMPLE = Path(__file__).parents[2] / "examples/arm.urdf"
TASK = Walk(duration=0.6)
STEPS = 40
ACTS = """
import json, sys
sys.path.insert(0, sys.argv[1] + "/modules")
import numpy as np
from pathlib import Path
from gsl.runner.acting import Actor
from gsl.runner.request import read_request
request = read_request(Path(sys.argv[1]))
seen = np.array(json.load(sys.stdin))
told = []
for episode in request["episodes"]:
    actor = Actor(request, episode)
    told.append([[part.tolist() for part in actor.act(observation)] for observation in seen])
strange = [name for name in ("numba", "pydantic", "gymnasium", "hydra", "scipy") if name in sys.modules]
print(json.dumps({"acted": told, "strange": strange}))
"""


def _policy(name: str) -> Policy:
    if name == "excitation":
        return Excitation(robot="nao", motions=("steps_large", "chirp"), duration=1.5)
    return restore(OmegaConf.to_container(OmegaConf.load(CONF / f"policy/{name}.yaml")))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", ["walk_engine", "linear", "linear_walk", "excitation"])
def test_the_runner_acts_as_the_policy_does_to_the_bit(name: str, noise: float, tmp_path: Path) -> None:
    policy, rng = _policy(name), np.random.default_rng(5)
    thetas = {str(n): neighbour(policy, policy.initial, 0.05, rng) for n in range(3)}
    held = {"floating": False} if name in ("linear", "excitation") else {}
    task = Excite(duration=1.5) if name == "excitation" else TASK
    folder = requested(tmp_path, policy, task, thetas, noise=noise, **held)
    layout = layout_of(read_request(folder))
    seen = rng.normal(size=(STEPS, layout.size))
    seen[:, layout["foot_force"]] = 30.0 * np.abs(seen[:, layout["foot_force"]])
    done = subprocess.run(
        [sys.executable, "-I", "-c", ACTS, str(folder)],
        input=json.dumps(seen.tolist()), capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    document = json.loads(done.stdout)
    assert document["strange"] == []
    for index, theta in enumerate(thetas.values()):
        run = policy.start(theta, layout)
        own = ActionNoise(sd=noise).start(layout, grounding_generator(index))
        actions = np.array([run.act(observation) for observation in seen])
        sent = np.array([own.transform(seen[0], action) for action in actions])
        np.testing.assert_array_equal(np.array(document["acted"][index])[:, 0], actions)
        np.testing.assert_array_equal(np.array(document["acted"][index])[:, 1], sent)


def test_a_policy_that_needs_more_than_numpy_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"gsl\.worlds\.mujoco needs mujoco, but beside a robot there is numpy"):
        bundle(("gsl.worlds.mujoco",))


def test_a_robot_elsewhere_has_the_feet_and_the_files_of_its_robot() -> None:
    four = ExternalRobot(robot="robots_elsewhere.four_feet").layout
    assert four.sizes["foot_force"] == 4 and four.sizes["gyro"] == 3
    assert "foot_force" not in ExternalRobot(robot="so101", floating=False).layout.sizes
    file, *_ = ExternalRobot(robot=str(EXAMPLE), floating=False).read_files.values()
    assert file == EXAMPLE


def test_a_forecast_is_made_at_any_control_period(tmp_path: Path) -> None:
    folder = requested(tmp_path, WalkEngine(), TASK, {"one": WalkEngine().initial}, period=0.015)
    assert read_request(folder)["control_period"] == 0.015


LIMITS = ExternalRobot(robot="nao").limits
JOINTS = ExternalRobot(robot="nao").layout.joints
PERIOD = 0.02


def _guard() -> Guard:
    guard = Guard(JOINTS, LIMITS, PERIOD)
    guard.start(np.zeros(15))
    return guard


def test_the_guard_lets_through_what_moves_within_the_limits() -> None:
    guard, time = _guard(), np.arange(0.0, 4.0, PERIOD)
    for now, target in zip(time, np.outer(np.sin(time), 0.05 * np.ones(15)), strict=True):
        assert guard.refusal(target, now) == ""
        guard.take(target, now)


@pytest.mark.parametrize(
    ("joint", "value", "problem"),
    [
        (3, np.nan, "LKneePitch: the target is not a finite number"),
        (3, -0.2, "LKneePitch: the target of -0.2 rad is below the limit of -0.09233 rad"),
        (2, 0.5, "LHipPitch: the target of 0.5 rad is above the limit of 0.484 rad"),
        (3, 0.2, "LKneePitch: the target jumps by 0.2 rad, more than the 0.1612 rad allowed"),
    ],
)
def test_the_guard_refuses_and_says_which_joint(joint: int, value: float, problem: str) -> None:
    target = np.zeros(15)
    target[joint] = value
    assert _guard().refusal(target, 0.0) == problem


def test_the_guard_refuses_what_is_too_fast_for_too_long() -> None:
    guard, problem = _guard(), ""
    for tick in range(1, 20):
        problem = guard.refusal(np.full(15, 0.14 * tick * (np.arange(15) == 3)), PERIOD * tick)
        if problem:
            break
        guard.take(np.full(15, 0.14 * tick * (np.arange(15) == 3)), PERIOD * tick)
    assert problem == "LKneePitch: the target moves 1.4 rad in 0.2 s, more than the 1.28 rad allowed"


def test_the_guard_refuses_another_number_of_joints() -> None:
    assert _guard().refusal(np.zeros(3), 0.0) == "15 targets are due, one a joint, not 3"


def test_a_ramp_begins_gently_ends_where_it_should_and_keeps_its_speed() -> None:
    start, end = np.zeros(2), np.array([1.5, -0.2])
    way = np.array([start, *ramp(start, end, 1.0, np.full(2, 0.5), PERIOD)])
    np.testing.assert_array_equal(way[-1], end)
    speed = np.abs(np.diff(way, axis=0)) / PERIOD
    assert speed.max() <= 0.5 * 1.001 and speed[0].max() < 0.02 and speed[-1].max() < 0.02


def test_after_a_fall_no_more_of_a_policy_is_due_where_that_is_said() -> None:
    episodes = [{"name": f"{policy}{n}", "policy": policy} for policy in "ab" for n in range(3)]
    left = {
        stop: [episode["name"] for episode in due({"until_fall": stop, "episodes": episodes}, {"a0", "a1"}, {"a1"})]
        for stop in (True, False)
    }
    assert left == {True: ["b0", "b1", "b2"], False: ["a2", "b0", "b1", "b2"]}


def test_what_a_journal_keeps_comes_back_and_an_episode_run_again_takes_its_place(tmp_path: Path) -> None:
    path, columns = tmp_path / "answer.csv", ["episode", "step", "time", "fell", "stopped"]
    for episode, fell in ((0, False), (10, False), (1, True), (0, True)):
        journal.keep(path, "h", columns, [[episode, 0, 0.1, False, False], [episode, 1, 1 / 3, fell, False]])
    assert journal.ends(path) == {10: False, 1: True, 0: True}
    assert journal.read_mark(path) == "h" and path.read_text().count("0.3333333333333333") == 3


ROBOT = """
import numpy as np
SIMULATED = True
at = np.array({start})
def read():
    return {{"position": at, "gyro": [0, 0, 0], "foot_force": [20, 20], {more}}}
def send(targets):
    global at
    at = targets
"""


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fast = {"ramp": 1.0, "ramp_speed": 2.0}
    return requested(
        tmp_path_factory.mktemp("walk"), WalkEngine(), TASK, {n: WalkEngine().initial for n in ("one", "two")}, **fast
    )


def _robot(folder: Path, more: str = "", start: str = "[0.0] * 15") -> str:
    path = folder / "mine.py"
    path.write_text(ROBOT.format(more=more, start=start))
    return f"--robot={path}"


def test_a_dry_run_plays_everything_and_writes_nothing(walk: Path) -> None:
    before = sorted(walk.rglob("*"))
    done = run(walk, "--dry-run")
    assert done.returncode == 0 and "no target was refused; nothing was written" in done.stdout
    assert "ms each of the 20 ms there are (50 Hz)" in done.stdout
    assert [path for path in sorted(walk.rglob("*")) if "__pycache__" not in path.parts] == before


def test_an_answer_in_two_sittings(walk: Path, tmp_path: Path) -> None:
    words = (_robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--unpaced")
    first = run(walk, *words, typed="\n\n0,12\n0.12\nq\n")
    assert first.returncode == 0 and "1 episodes are missing" in first.stdout
    assert "'0,12' is no number of metres" in first.stdout
    assert run(walk, *words).stdout.endswith("runner.py: there is nobody to ask; --yes asks nothing\n")
    second = run(walk, *words, typed="\n\nf\n")
    assert "all is answered" in second.stdout
    assert journal.ends(tmp_path / "answer.csv") == {0: False, 1: False}
    rows = journal.read_returns(tmp_path / "returns.csv")
    assert (rows["one"]["distance"], rows["one"]["fell"]) == ("0.12", "no")
    assert (rows["two"]["distance"], rows["two"]["fell"]) == ("", "yes")


BROKEN = """
reads, plain = -1000, read
def begin(episode):
    global reads
    reads = 0
def read():
    global reads
    reads += 1
    if reads == 18:
        raise KeyboardInterrupt
    return plain()
"""


@pytest.mark.parametrize(("typed", "kept"), [("y", {0: True}), ("n", {})])
def test_an_episode_broken_off_is_a_fall_if_a_person_says_so_and_else_nothing(
    walk: Path, tmp_path: Path, typed: str, kept: dict[int, bool]
) -> None:
    path = Path(_robot(tmp_path).removeprefix("--robot="))
    path.write_text(path.read_text() + BROKEN)
    log = tmp_path / "answer.csv"
    done = run(walk, f"--robot={path}", f"--log={log}", "--unpaced", typed=f"\n\n{typed}\n\nq\n")
    assert "was it a fall?" in done.stdout
    assert journal.ends(log) == kept
    if kept:
        rows = [line.split(",") for line in log.read_text().splitlines()[2:]]
        assert len(rows) == 18 and rows[-1][1] == "17" and rows[-1][3] == ""  # the last action has no state


def test_a_clock_that_is_real_keeps_the_rate(walk: Path, tmp_path: Path) -> None:
    for _ in range(5):  # a machine that is busy may miss a tick, and then nothing is kept
        if run(walk, _robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--yes", "--episode=one").returncode == 0:
            break
    times = np.loadtxt(tmp_path / "answer.csv", delimiter=",", skiprows=2, usecols=2, dtype=float)
    assert len(times) == 31 and np.diff(times).min() > 0.0
    assert np.median(np.diff(times)) == pytest.approx(PERIOD, rel=0.1)


@pytest.mark.parametrize(
    ("more", "start", "words", "problem"),
    [
        ("'gyroscope': 1", "[0.0] * 15", (), "read() gives 'gyroscope', which is none of acceleration, "),
        ("'gyro': [1, 2]", "[0.0] * 15", (), "read() gives 2 numbers for 'gyro', not 3"),
        ("'gyro': [1, 2, float('nan')]", "[0.0] * 15", (), "read() gives for 'gyro' a number that is not finite"),
        ("'gyro': 'fast'", "[0.0] * 15", (), "read() gives for 'gyro' what is no list of numbers"),
        ("'fell': True", "[0.0] * 15", (), "the robot lies down before one has begun"),
        ("'fell': 1 / 0", "[0.0] * 15", (), "read() failed: ZeroDivisionError: division by zero"),
        ("", "[0.0] * 14 + [3.0]", (), "RShoulderRoll: is at 3 rad, 2.686 rad outside of its range; bring it by hand"),
        ("", "[0.0] * 15", ("--episode=three",), "there is no episode three; there is one, two"),
        ("", "[0.0] * 15", ("--robot=none.py",), "none.py does not exist; --robot names the file with read() and send"),
    ],
)
def test_the_runner_refuses_in_one_line(
    walk: Path, tmp_path: Path, more: str, start: str, words: tuple[str, ...], problem: str
) -> None:
    log = tmp_path / "answer.csv"
    done = run(walk, _robot(tmp_path, more, start), f"--log={log}", "--yes", "--unpaced", *words)
    assert done.returncode == 2 and done.stderr == ""
    assert done.stdout.splitlines()[-1].startswith(f"runner.py: {problem}")
    assert not log.exists()


def test_a_request_that_was_changed_is_not_run(walk: Path, tmp_path: Path) -> None:
    request = json.loads((walk / "request.json").read_text())
    other = tmp_path / "other"
    other.mkdir()
    (other / "runner.py").write_text((walk / "runner.py").read_text())
    (other / "modules").symlink_to(walk / "modules")
    request["limits"]["upper"][0] = 9.0
    (other / "request.json").write_text(json.dumps(request))
    assert "was changed after it was written" in run(other, "--dry-run").stdout


def test_an_unsafe_target_stops_the_episode_safely_and_counts_as_a_fall(tmp_path: Path) -> None:
    theta = dict(zip(WalkEngine().names, WalkEngine().initial, strict=True)) | {"arm_swing": 200.0}
    wild = np.array(list(theta.values()))
    folder = requested(tmp_path, WalkEngine(), Walk(duration=1.2), {"wild": wild}, ramp=1.0)
    assert "wild asks in simulation after" in (folder / "README.txt").read_text()
    assert run(folder, "--dry-run").returncode == 1
    lines = ROBOT.format(more="", start="[0.0] * 15") + "    all_sent.append(targets)\nall_sent = []\n"
    lines += "def end():\n    np.save('sent.npy', np.array(all_sent))\n"
    (tmp_path / "mine.py").write_text(lines.replace("'sent.npy'", repr(str(tmp_path / "sent.npy"))))
    done = run(folder, f"--robot={tmp_path / 'mine.py'}", "--yes", "--unpaced")
    assert "wild: " in done.stdout and "refused: " in done.stdout and "held, then ramped out" in done.stdout
    assert journal.ends(folder / "answer.csv") == {0: True}
    sent, guard = np.load(tmp_path / "sent.npy"), Guard(JOINTS, LIMITS, PERIOD)
    guard.start(sent[0])
    for tick, target in enumerate(sent):
        assert guard.refusal(target, PERIOD * tick) == ""
        guard.take(target, PERIOD * tick)


def test_the_policy_of_a_request_is_all_of_it(walk: Path) -> None:
    request = read_request(walk)
    assert request["policy"] == describe(WalkEngine())
    assert request["episodes"][0]["parameters"] == WalkEngine().initial.tolist()


class Slow(PerfectRobot):
    """A perfect robot whose readings take a while, and that knows when it was sent what."""

    def __init__(self, request: dict, time: Simulated, takes: np.ndarray, shift: float = 0.0) -> None:
        super().__init__(request)
        self._time, self._takes, self._shift, self.sent, self.began = time, takes, shift, [], []

    def begin(self, episode: dict) -> None:
        self.sent.clear()

    def read(self) -> dict:
        self._time.until(self._time.now() + self._takes[len(self.sent) % len(self._takes)])
        batch = super().read()
        return {**batch, "position": batch["position"] + self._shift}

    def send(self, targets: np.ndarray) -> None:
        super().send(targets)
        self.sent.append(self._time.now())


def _slow(walk: Path, takes: np.ndarray, shift: float = 0.0) -> tuple[Player, Slow]:
    time, request = Simulated(), read_request(walk)
    robot = Slow(request, time, takes, shift)
    return Player(request, robot, time), robot


@pytest.mark.parametrize("seed", range(3))
def test_no_two_targets_are_closer_than_nearly_a_period_however_late_a_reading_is(walk: Path, seed: int) -> None:
    takes = np.random.default_rng(seed).uniform(0.0, 2.5 * PERIOD, 50)
    player, robot = _slow(walk, takes)
    episode = player.request["episodes"][0]
    player.approach(episode)
    played = player.play(episode)
    assert len(played.rows) == 31 and np.diff(robot.sent).min() >= 0.9 * PERIOD - 1e-12
    assert played.late > PERIOD


def test_a_tick_that_is_far_too_late_ends_the_episode(walk: Path) -> None:
    player, _ = _slow(walk, np.where(np.arange(50) == 20, 5.0 * PERIOD, 0.0))
    episode = player.request["episodes"][0]
    player.approach(episode)
    with pytest.raises(RobotError, match=r"one: at 0\.50 s a tick came 80 ms late; stopped and not kept"):
        player.play(episode)


def test_an_episode_off_the_rate_is_not_kept(walk: Path, tmp_path: Path) -> None:
    late = "import time\nreads, plain = -1000, read\ndef begin(episode):\n    global reads\n    reads = 0\n"
    late += "def read():\n    global reads\n    reads += 1\n"
    word = _fails(tmp_path, late + "    time.sleep(0.038 * (reads == 20))\n    return plain()\n")
    done = run(walk, word, f"--log={tmp_path / 'answer.csv'}", "--yes")
    assert done.returncode == 2 and "not kept; run it again" in done.stdout
    assert not (tmp_path / "answer.csv").exists()


def test_a_policy_that_fails_is_told_in_one_line(walk: Path) -> None:
    request = read_request(walk)
    with pytest.raises(GslError, match="one: its policy failed: "):
        Actor(request, {**request["episodes"][0], "parameters": [[0.0]]}).act(np.zeros(1))


def test_the_guard_judges_speed_by_the_time_that_passed() -> None:
    step = 0.1 * (np.arange(15) == 3)
    problems = {}
    for period in (PERIOD, 0.5 * PERIOD):
        guard = _guard()
        for tick in range(1, 20):
            if problem := guard.refusal(step * tick, period * tick):
                problems[period] = problem
                break
            guard.take(step * tick, period * tick)
    assert list(problems) == [0.5 * PERIOD] and "in 0.2 s" in problems[0.5 * PERIOD]


def test_a_robot_that_does_not_arrive_is_not_let_go(walk: Path) -> None:
    player, _ = _slow(walk, np.zeros(1), shift=0.25)
    with pytest.raises(RobotError, match="is 0.25 rad off after the ramp to the start of one; it is left where it is"):
        player.approach(player.request["episodes"][0])


def test_a_ramp_keeps_to_half_of_a_slow_joints_limit(tmp_path: Path) -> None:
    slow = {"speed": 0.05, "ramp": 1.0, "ramp_speed": 2.0}
    folder = requested(tmp_path, WalkEngine(), TASK, {"one": WalkEngine().initial}, **slow)
    player, robot = _slow(folder, np.zeros(1))
    for _ in range(2):  # it stands still elsewhere
        robot.send(np.zeros(15))
    robot.fastest = np.zeros(15)
    player.approach(player.request["episodes"][0])
    assert (robot.fastest <= 0.5 * np.array(player.request["limits"]["speed"]) * 1.001).all()
    assert robot.fastest.max() > 0.0


def _fails(folder: Path, what: str) -> str:
    word = _robot(folder)
    path = Path(word.removeprefix("--robot="))
    path.write_text(path.read_text() + what)
    return word


LEAVES = """
sends, plain = -1000, send
def begin(episode):
    global sends
    sends = 0
def send(targets):
    global sends
    sends += 1
    if sends == 30 + 3:
        raise {error}
    plain(targets)
"""


@pytest.mark.parametrize("error", ["KeyboardInterrupt", "OSError('gone')"])
def test_an_episode_that_is_over_is_kept_though_the_way_out_fails(walk: Path, tmp_path: Path, error: str) -> None:
    log = tmp_path / "answer.csv"
    done = run(walk, _fails(tmp_path, LEAVES.format(error=error)), f"--log={log}", "--yes", "--unpaced")
    assert done.returncode in (2, 130) and "one: 30 steps" in done.stdout
    assert journal.ends(log) == {0: False}


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ("def begin(episode):\n    1 / 0\n", "begin() failed: ZeroDivisionError: division by zero"),
        (
            "def end():\n    1 / 0\n",
            "one: could not be brought back: end() failed: ZeroDivisionError: division by zero",
        ),
        ("SIMULATED = False\n", "--unpaced is for a rehearsal; "),
        ("plain = read\ndef read():\n    return {**plain(), 'fell': 'no'}\n", "read() gives for 'fell' 'no', which"),
    ],
)
def test_what_a_robot_file_does_wrong_is_told_in_one_line(walk: Path, tmp_path: Path, more: str, problem: str) -> None:
    done = run(walk, _fails(tmp_path, more), f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and done.stderr == ""
    assert done.stdout.splitlines()[-1].startswith(f"runner.py: {problem}")


def test_nobody_at_the_prompt_means_back_to_where_it_was(walk: Path, tmp_path: Path) -> None:
    word = _fails(tmp_path, "def end():\n    open(__file__ + '.end', 'w').close()\n")
    done = run(walk, word, f"--log={tmp_path / 'answer.csv'}", "--unpaced", typed="\n")
    assert done.returncode == 2 and "there is nobody to ask" in done.stdout
    assert (tmp_path / "mine.py.end").exists()


BEHAVES = """
sent, episodes, plain_read, plain_send = 0, 0, read, send
def begin(episode):
    global sent, episodes
    sent, episodes = 1000, episodes + 1
def send(targets):
    global sent, at
    sent += 1
    open(__file__ + '.sent', 'a').write(f'{{sent}}\\n')
    if {follows}:
        at = targets
def read():
    if {breaks}:
        raise KeyboardInterrupt
    return {{**plain_read(), 'fell': {fell}}}
"""


def _behaves(
    folder: Path, *, fell: str = "False", follows: str = "True", breaks: str = "False", start: str = ""
) -> str:
    word = _robot(folder, start=start or "[0.0] * 15")
    path = Path(word.removeprefix("--robot="))
    path.write_text(path.read_text() + BEHAVES.format(fell=fell, follows=follows, breaks=breaks))
    return word


FAR_AWAY = "[0.0] * 4 + [-0.9] + [0.0] * 10"


@pytest.mark.parametrize(
    ("behaviour", "problem", "most"),
    [
        ({"fell": "sent == 10"}, "the robot lies down; nothing more is sent to it", 10),
        ({"fell": "sent == 1035"}, "one: the robot lies down; nothing more is sent to it", 1035),
        ({"follows": "False", "start": FAR_AWAY}, "LShoulderPitch: stands still, though it was sent 0.2", 50),
        (
            {"follows": "sent < 1032", "breaks": "sent == 1040"},
            "one: the way back was broken off; the robot is left",
            0,
        ),
        ({"fell": "episodes == 1 and sent > 1019"}, "the robot lies down before two has begun; set it up, and", 1020),
    ],
)
def test_a_ramp_and_a_hold_look_at_the_robot(
    walk: Path, tmp_path: Path, behaviour: dict[str, str], problem: str, most: int
) -> None:
    done = run(walk, _behaves(tmp_path, **behaviour), f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    code, interrupted = (130, "interrupted; ") if behaviour.get("breaks") else (2, "")
    assert done.returncode == code and done.stderr == ""
    assert done.stdout.splitlines()[-1].startswith(f"runner.py: {interrupted}{problem}")
    sent = (tmp_path / "mine.py.sent").read_text().split()
    assert int(sent[-1]) == most or not most or (most == 50 and int(sent[-1]) < 1000)


def test_a_robot_that_stands_still_is_stopped_and_left_where_it_does_not_follow(tmp_path: Path) -> None:
    folder = requested(tmp_path, WalkEngine(), Walk(duration=3.0), {"one": WalkEngine().initial}, ramp=1.0)
    done = run(folder, _behaves(tmp_path, follows="sent < 1000"), "--yes", "--unpaced")
    assert "stands still, though it was sent 0.2" in done.stdout and "; held, then ramped out" in done.stdout
    assert journal.ends(folder / "answer.csv") == {0: True}


def test_the_first_fault_is_told_before_where_the_robot_was_left(walk: Path, tmp_path: Path) -> None:
    word = _behaves(tmp_path, fell="1 / 0 if sent == 1010 else False", breaks="sent == 1020")
    path = Path(word.removeprefix("--robot="))
    path.write_text(path.read_text().replace("1 / 0 if", "once(sent) if") + FAILS_ONCE)
    done = run(walk, word, f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert done.stdout.splitlines()[-1] == (
        "runner.py: read() failed: ZeroDivisionError: division by zero; "
        "one: the way back was broken off; the robot is left where it is"
    )


@pytest.mark.parametrize(
    ("behind", "off", "problem"),
    [(10, 0.1, ""), (1, -0.5, "b: is 0.5 rad off its targets"), (25, 0.0, "b: stands still, though it was sent 0.25")],
)
def test_a_joint_may_be_late_but_not_far_off(behind: int, off: float, problem: str) -> None:
    following, answer = Following(("a", "b"), 0.2), ""
    way = np.outer(np.arange(100) * 0.05, [0.0, 1.0])  # rad, 2.5 rad/s
    following.start(way[0], 0.0)
    for tick in range(100):
        answer = answer or following.problem(way[max(0, tick - behind)] + [0.0, off], PERIOD * tick)
        following.note(way[tick], PERIOD * tick)
    assert answer.startswith(problem) and bool(answer) == bool(problem)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_signal_to_end_brings_the_robot_back(walk: Path, tmp_path: Path, name: str) -> None:
    ends = FAILS_ONCE.replace("1 / 0", f"os.kill(os.getpid(), signal.{name})")
    ends += "import os, signal\ndef end():\n    open(__file__ + '.end', 'w').close()\n"
    word = _behaves(tmp_path, breaks="sent == 1010 and once(sent)")
    path = Path(word.removeprefix("--robot="))
    path.write_text(path.read_text() + ends)
    done = run(walk, word, f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert done.returncode == 130 and done.stdout.endswith("runner.py: interrupted; what was complete is kept\n")
    assert (tmp_path / "mine.py.end").exists() and not (tmp_path / "answer.csv").exists()


FAILS_ONCE = """
failed = []
def once(sent):
    if not failed:
        failed.append(1)
        1 / 0
    return False
"""


@pytest.fixture(scope="module")
def lines(walk: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The lines of a whole answer."""
    folder = tmp_path_factory.mktemp("whole")
    assert run(walk, _robot(folder), f"--log={folder / 'answer.csv'}", "--yes", "--unpaced").returncode == 0
    return (folder / "answer.csv").read_text().splitlines(keepends=True)


def _never(folder: Path) -> str:
    return _fails(folder, "def send(targets):\n    open(__file__ + '.sent', 'w').close()\n")


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda lines: lines[:1], "holds no more than which request it answers; remove it"),
        (lambda lines: [lines[0], lines[1].replace("time,", "when,"), *lines[2:]], "has no column time; move it away"),
        (lambda lines: [lines[0], lines[1].replace("gyro.x", "gyro"), *lines[2:]], "has other columns than the robot"),
        (lambda lines: [*lines[:5], lines[5].replace("0,", "x,", 1), *lines[6:]], "line 6: there is no episode 'x'"),
        (lambda lines: [*lines[:5], lines[5].replace("0,", "7,", 1), *lines[6:]], "line 6: there is no episode '7'"),
        (
            lambda lines: [*lines[:5], lines[5].replace("0,3,", "0,fast,"), *lines[6:]],
            "line 6: step is 'fast', not a n",
        ),
        (lambda lines: [*lines[:5], lines[5].replace("false", "no"), *lines[6:]], "line 6: fell is 'no', not true or"),
        (lambda lines: [*lines[:5], "0,1\n", *lines[6:]], "line 6: has another number of cells than there are col"),
        (lambda lines: [*lines[:9], *lines[33:]], "line 10: one has no last row; remove the rows of that episode"),
        (lambda lines: [*lines[:33], *lines[2:33]], "line 34: one is there twice; remove the rows of that episode"),
    ],
)
def test_a_damaged_answer_is_told_before_anything_moves(
    walk: Path, tmp_path: Path, lines: list[str], spoil: Callable[[list[str]], list[str]], problem: str
) -> None:
    log = tmp_path / "answer.csv"
    log.write_text("".join(spoil(lines)))
    done = run(walk, _never(tmp_path), f"--log={log}", "--yes", "--unpaced")
    assert done.returncode == 2 and done.stderr == ""
    assert done.stdout.splitlines()[-1].startswith(f"runner.py: {log}: {problem}")
    assert not (tmp_path / "mine.py.sent").exists()


@pytest.mark.parametrize("cut", [2, 30, 2000, 5000])
def test_a_last_episode_that_was_cut_off_is_run_again(walk: Path, tmp_path: Path, lines: list[str], cut: int) -> None:
    log = tmp_path / "answer.csv"
    log.write_text("".join(lines)[: -1 - cut])
    done = run(walk, _robot(tmp_path), f"--log={log}", "--yes", "--unpaced")
    assert done.returncode == 0 and "its last episode was cut off; it is dropped, to be run again" in done.stdout
    assert "two: 30 steps" in done.stdout and "one: 30 steps" not in done.stdout
    assert journal.ends(log) == {0: False, 1: False}


def test_an_answer_without_its_last_newline_is_whole(walk: Path, tmp_path: Path, lines: list[str]) -> None:
    log = tmp_path / "answer.csv"
    log.write_text("".join(lines).rstrip("\n"))
    assert "cut off" not in run(walk, _robot(tmp_path), f"--log={log}", "--yes", "--unpaced").stdout
    assert log.read_text() == "".join(lines)


def test_a_log_that_cannot_be_written_is_told_before_anything_moves(walk: Path, tmp_path: Path) -> None:
    for log, problem in ((tmp_path / "none/a.csv", "none: there is no such folder; make it"), (tmp_path, "is no file")):
        done = run(walk, _never(tmp_path), f"--log={log}", "--yes", "--unpaced")
        assert done.returncode == 2 and problem in done.stdout and done.stderr == ""
    assert not (tmp_path / "mine.py.sent").exists()


def test_a_log_that_cannot_be_written_later_is_told_when_the_robot_is_back(walk: Path, tmp_path: Path) -> None:
    place = tmp_path / "place"
    place.mkdir()
    gone = f"import shutil\ndef begin(episode):\n    shutil.rmtree({str(place)!r})\n"
    word = _fails(tmp_path, gone + "def end():\n    open(__file__ + '.end', 'w').close()\n")
    done = run(walk, word, f"--log={place / 'answer.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and done.stderr == "" and (tmp_path / "mine.py.end").exists()
    assert done.stdout.splitlines()[-1].endswith("answer.csv.tmp cannot be read or written: No such file or directory")


def test_two_runners_are_one_too_many_and_a_dead_one_is_none(walk: Path, tmp_path: Path) -> None:
    words = (_robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    with preflight.alone(walk):
        done = run(walk, *words)
        assert done.returncode == 2 and "another runner (process " in done.stdout and done.stderr == ""
    assert (walk / preflight.LOCK).exists() and run(walk, *words).returncode == 0


def test_a_sense_that_is_missing_at_times_is_blank_and_a_new_one_is_refused(walk: Path, tmp_path: Path) -> None:
    log, reads = tmp_path / "answer.csv", "reads, plain = 0, read\ndef read():\n    global reads\n    reads += 1\n"
    some = reads + "    return {**plain(), **({'voltage': 21.5} if reads % 3 == 1 else {})}\n"
    assert run(walk, _fails(tmp_path, some), f"--log={log}", "--yes", "--unpaced").returncode == 0
    volts = {row["voltage"] for row in journal.table(log)[1]}
    assert volts == {"", "21.5"}
    for more, problem in (
        ("'temperature': [30] * 15", "has no column temperature.LHipYawPitch, which the robot tells now"),
        ("'gyro': [1, 2, 3], 'base.position': [0, 0, 0]", "has no column base.position.x, which the robot tells now"),
    ):
        done = run(walk, _robot(tmp_path, more), f"--log={log}", "--yes", "--unpaced", "--episode=one")
        assert done.returncode == 2 and problem in done.stdout


def test_a_base_that_is_lost_is_no_blank(walk: Path, tmp_path: Path) -> None:
    late = "def begin(episode):\n    global blind\n    blind = True\nblind, plain = False, read\ndef read():\n"
    late += "    return {**plain(), **({} if blind else {'base.position': [0, 0, 0]})}\n"
    done = run(walk, _fails(tmp_path, late), f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and "read() gives no base.position.x any more; without it" in done.stdout


def test_missing_distances_are_named_and_asked_for_at_the_next_start(walk: Path, tmp_path: Path) -> None:
    words = (_robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--unpaced")
    first = run(walk, *words, "--yes").stdout
    assert "distances are missing: one, two; start again without --yes, or write" in first and "all is" not in first
    second = run(walk, *words, typed="0.3\n\n").stdout
    assert "one is logged, but nobody has said how far it came" in second and "distances are missing: two;" in second
    assert "all is answered" in run(walk, *words, typed="f\n").stdout
    rows = journal.read_returns(tmp_path / "returns.csv")
    assert (rows["one"]["distance"], rows["two"]["fell"]) == ("0.3", "yes")


def test_an_episode_run_again_forgets_what_was_measured_before(walk: Path, tmp_path: Path) -> None:
    words = (_robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--unpaced")
    run(walk, *words, typed="\n\nf\n\n\n0.2\n")
    again = run(walk, *words, "--yes", "--episode=one").stdout
    assert "distances are missing: one;" in again
    assert list(journal.read_returns(tmp_path / "returns.csv")) == ["two"]


def test_an_episode_that_leaves_no_log_takes_the_earlier_one_away(tmp_path: Path) -> None:
    path = tmp_path / "answer.csv"
    for episode in (0, 1):
        journal.keep(path, "h", ["episode", "fell", "stopped"], [[episode, False, False]])
    journal.drop(path, 0)
    assert journal.ends(path) == {1: False}
    journal.drop(path, 1)
    assert not path.exists()


@pytest.mark.parametrize("name", ["answer.csv", "returns.csv"])
def test_what_answers_another_request_is_not_added_to(walk: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(f"{journal.MARK}abc\nepisode,distance,fell\none,1,no\n")
    done = run(walk, _robot(tmp_path), f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and f"{name}: answers another request" in done.stdout
    with pytest.raises(ArtifactError, match="answers another request"):
        journal.add_return(tmp_path / name, "h", "one", "2", fell=False)


def test_returns_written_by_hand_keep_their_columns(tmp_path: Path) -> None:
    path = tmp_path / "returns.csv"
    path.write_bytes(b'\xef\xbb\xbfepisode,value,fell,note\r\none,0.3,TRUE,"wet, cold"\r\ntwo,0.2,no,\r\n')
    journal.add_return(path, "h", "two", "1.5", fell=False)
    rows = journal.read_returns(path)
    assert rows["one"] == {"episode": "one", "value": "0.3", "fell": "TRUE", "note": "wet, cold", "distance": ""}
    assert rows["two"]["distance"] == "1.5" and rows["two"]["value"] == ""
    assert journal.is_yes(rows["one"]["fell"]) and journal.read_mark(path) == ""
