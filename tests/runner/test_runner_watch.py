"""What never returns does not keep the runner: it is named, the robot is brought back, and Ctrl-C ends it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from robots_elsewhere import requested, run

from gsl.errors import ArtifactError
from gsl.policies.walk_engine import WalkEngine
from gsl.runner.bounds import limits_problem, narrowest
from gsl.runner.guard import Guard
from gsl.runner.request import hash_of, read_request
from gsl.runner.robots import robot_of
from gsl.runner.senses import RobotError
from gsl.runner.watch import Hangs, Watch, is_stuck
from gsl.tasks.walk import Walk
from gsl.worlds.external import ExternalRobot

pytestmark = pytest.mark.slow

JOINTS = ExternalRobot(robot="nao").layout.joints
LIMITS = ExternalRobot(robot="nao").limits
PERIOD = 0.02
ROBOT = """
import ctypes, threading, time
import numpy as np
SIMULATED, TIME_LIMIT = True, 0.4
at, calls, acting = np.zeros(15), {"read": 0, "send": 0, "begin": 0, "end": 0}, False
WHERE, WHAT, AT, AGAIN = HANGS
def count(name):
    calls[name] += 1
    before = calls[name] == AT if AGAIN == "once" else calls[name] >= AT
    if name == WHAT and before and (WHERE == "anywhere" or acting):
        HOW
def read():
    count("read")
    return {"position": at, "gyro": [0, 0, 0], "foot_force": [20, 20]}
def send(targets):
    global at
    count("send")
    at = targets
    with open(__file__ + ".sent", "a") as file:
        file.write(" ".join(map(repr, targets.tolist())) + "\\n")
def begin(episode):
    global acting, calls
    acting, calls = True, dict.fromkeys(calls, 0)
    count("begin")
def end():
    count("end")
"""
SLEEPS = "time.sleep(1e6)"
LOCKS = "lock = threading.Lock(); lock.acquire(); lock.acquire()"
SWALLOWS = "\n        while True:\n            try: time.sleep(1)\n            except BaseException: pass"
KEEPS = "ctypes.PyDLL(None).sleep(1000)"  # a library that does not give the interpreter back


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fast = {"ramp": 1.0, "ramp_speed": 2.0}
    return requested(tmp_path_factory.mktemp("walk"), WalkEngine(), Walk(duration=0.6), {"one": WalkEngine().initial},
                     **fast)  # fmt: skip


def robot(folder: Path, how: str, *hangs: object) -> Path:
    path = folder / "mine.py"
    path.write_text(ROBOT.replace("HANGS", repr(hangs)).replace("HOW", how))
    return path


def sent(path: Path) -> np.ndarray:
    return np.loadtxt(path.with_name("mine.py.sent"), ndmin=2)


def check_safe(targets: np.ndarray) -> None:
    """No target breaks a limit, and the last one is the start posture."""
    guard = Guard(JOINTS, LIMITS, PERIOD)
    guard.start(targets[0])
    for tick, target in enumerate(targets):
        assert guard.refusal(target, PERIOD * tick) == ""
        guard.take(target, PERIOD * tick)


@pytest.mark.parametrize("how", [SLEEPS, LOCKS, SWALLOWS])
def test_reading_that_hangs_is_named_and_the_robot_brought_back_unseen(walk: Path, tmp_path: Path, how: str) -> None:
    path, begin = robot(tmp_path, how, "acting", "read", 12, "always"), time.monotonic()
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and done.stderr == "" and time.monotonic() - begin < 20.0
    assert done.stdout.splitlines()[-1] == (
        "runner.py: read() has not returned for 0.4 s; the robot was held, then ramped unseen to its start"
    )
    check_safe(sent(path))
    np.testing.assert_allclose(sent(path)[-1], read_request(walk)["episodes"][0]["posture"], atol=1e-12)
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize(
    ("hangs", "problem"),
    [
        (("acting", "send", 12, "once"), "send() has not returned for 0.4 s; the robot was held, then ramped to its s"),
        (
            ("acting", "send", 12, "always"),
            "send() has not returned for 0.4 s; one: could not be brought back: send() has not returned for 0.4 s",
        ),
        (("anywhere", "read", 1, "always"), "read() has not returned for 2 s"),
        (("anywhere", "read", 10, "always"), "read() has not returned for 0.4 s; the robot was held, then ramped unse"),
        (("acting", "read", 40, "always"), "read() hangs; the robot was held, then ramped unseen to its start"),
        (("acting", "begin", 1, "always"), "begin() has not returned for 2 s; the robot was held, then ramped to its"),
        (("acting", "end", 1, "always"), "one: could not be brought back: end() has not returned for 2 s"),
    ],
)
def test_whatever_hangs_is_named_with_what_became_of_the_robot(
    walk: Path, tmp_path: Path, hangs: tuple[object, ...], problem: str
) -> None:
    path = robot(tmp_path, LOCKS, *hangs)
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert done.returncode == 2 and done.stderr == ""
    assert done.stdout.splitlines()[-1].startswith(f"runner.py: {problem}")
    if path.with_name("mine.py.sent").exists():
        check_safe(sent(path))
    assert (tmp_path / "a.csv").exists() == (hangs[1:3] in (("read", 40), ("end", 1)))  # the episode was over


def test_a_function_that_keeps_the_interpreter_ends_the_runner_and_is_named(walk: Path, tmp_path: Path) -> None:
    path = robot(tmp_path, KEEPS, "acting", "read", 12, "always")
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert done.returncode != 0 and done.stdout.splitlines()[-1] == (
        "runner.py: read() has not returned for 0.8 s and lets nothing else act; the runner is ended, the robot is "
        "left at its last target"
    )


@pytest.mark.parametrize("how", [LOCKS, SWALLOWS])
def test_ctrl_c_ends_a_runner_whose_robot_hangs(walk: Path, tmp_path: Path, how: str) -> None:
    path = robot(
        tmp_path, f"open(__file__ + '.hangs', 'w').close(); {how}".replace("; \n", "\n"), "acting", "read", 12, "always"
    )
    path.write_text(path.read_text().replace("TIME_LIMIT = True, 0.4", "TIME_LIMIT = True, 4.0"))
    words = [sys.executable, "-I", str(walk / "runner.py"), f"--robot={path}", f"--log={tmp_path / 'a.csv'}"]
    with subprocess.Popen([*words, "--yes", "--unpaced"], stdout=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "mine.py.hangs").exists():
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        out, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out.splitlines()[-1] == (
        "runner.py: interrupted; read() hangs; the robot was held, then ramped unseen to its start; "
        "what was complete is kept"
    )


def test_a_robot_that_lay_down_is_not_moved_when_reading_hangs(walk: Path, tmp_path: Path) -> None:
    path = robot(tmp_path, LOCKS, "acting", "read", 13, "always")
    path.write_text(path.read_text().replace("[20, 20]}", '[20, 20], "fell": acting and calls["read"] == 12}'))
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert "read() hangs and the robot lay down when it was last seen; nothing more is sent" in done.stdout
    assert (tmp_path / "a.csv").exists()  # the fall is kept


def test_a_call_costs_little_and_gives_back_what_it_gives() -> None:
    watch = Watch()

    def part() -> list[int]:
        return [watch.call("double", lambda x: 2 * x, n) for n in range(2000)]

    begin = time.perf_counter()
    assert watch.run(part) == [2 * n for n in range(2000)]
    assert (time.perf_counter() - begin) / 2000 < 0.001  # a twentieth of a control period, on a busy machine
    with pytest.raises(ZeroDivisionError):
        watch.run(watch.call, "fails", lambda: 1 / 0)


def test_what_was_given_up_does_nothing_more_when_it_returns_after_all() -> None:
    watch, after = Watch(0.1), []

    def part() -> None:
        watch.call("waits", time.sleep, 0.6)
        watch.call("acts", after.append, 1)

    with pytest.raises(Hangs, match=r"waits\(\) has not returned for 0\.1 s"):
        watch.run(part)
    assert watch.hung == {"waits"} and watch.run(lambda: 2) == 2 and is_stuck()
    time.sleep(0.8)
    assert after == [] and not is_stuck()


@pytest.mark.parametrize("name", ["read", "send", "begin", "end"])
@pytest.mark.parametrize(
    ("how", "problem"),
    [
        ("raise SystemExit(0)", "SystemExit: 0"),
        ("import asyncio; raise asyncio.CancelledError('the server went')", "CancelledError: the server went"),
    ],
)
def test_no_function_of_a_robot_ends_the_runner(walk: Path, tmp_path: Path, name: str, how: str, problem: str) -> None:
    path = robot(tmp_path, how, "acting", name, 1, "once")
    ended = run(walk, "--yes", "--unpaced", f"--robot={path}", f"--log={tmp_path / 'answer.csv'}")
    assert (ended.returncode, ended.stderr) == (2, "")
    assert f"{name}() failed: {problem}" in ended.stdout
    assert np.allclose(sent(path)[-1], read_request(walk)["episodes"][0]["posture"])


def test_a_robots_file_that_ends_python_is_refused(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("raise SystemExit(0)\n")
    ended = run(walk, "--yes", f"--robot={tmp_path / 'mine.py'}", f"--log={tmp_path / 'answer.csv'}")
    assert (ended.returncode, ended.stdout.endswith("mine.py cannot be loaded: SystemExit: 0\n")) == (2, True)


def test_a_reading_that_hangs_when_it_is_looked_at_is_named(walk: Path, tmp_path: Path) -> None:
    path = robot(tmp_path, "globals().update(at=Late())", "acting", "read", 5, "once")
    late = "class Late:\n    def __array__(self, *words, **more):\n        time.sleep(1e6)\n"
    path.write_text(path.read_text().replace("def count", f"{late}def count"))
    ended = run(walk, "--yes", "--unpaced", f"--robot={path}", f"--log={tmp_path / 'answer.csv'}")
    assert (ended.returncode, ended.stderr) == (2, "")
    assert "read() has not returned for 0.4 s; the robot was held, then ramped unseen" in ended.stdout


def test_the_answer_is_where_it_was_asked_for_though_a_robot_changes_the_folder(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    path = robot(tmp_path, "pass", "anywhere", "read", 0, "once")
    path.write_text(
        f"import os, sys\nos.chdir({str(tmp_path / 'elsewhere')!r})\nsys.stdout.close()\n{path.read_text()}"
    )
    line = [sys.executable, "-I", str(walk / "runner.py"), "--yes", "--unpaced", f"--robot={path}", "--log=answer.csv"]
    ended = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert (tmp_path / "answer.csv").is_file() and not [*(tmp_path / "elsewhere").iterdir()]


def test_a_time_limit_that_is_none_is_refused(walk: Path, tmp_path: Path) -> None:
    path = robot(tmp_path, SLEEPS, "acting", "read", 12, "always")
    path.write_text(path.read_text().replace("True, 0.4", "True, float('nan')"))
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert "TIME_LIMIT of the robot's file is nan, not a positive number of seconds" in done.stdout


KEEPING = {
    "thread": ("threading.Thread(target=time.sleep, args=(1e6,), name='motors').start()", "motors"),
    "pool": (
        "import concurrent.futures as f; pool = f.ThreadPoolExecutor(1, 'motors'); pool.submit(time.sleep, 1e6)",
        "motors_0",
    ),
    "process": (
        "from multiprocessing import Process; c = Process(target=time.sleep, args=(1e6,), name='drives'); c.start()\n"
        "open(__file__ + '.child', 'w').write(str(c.pid))",
        "drives",
    ),
    "end of Python": ("import atexit; atexit.register(time.sleep, 1e6)", "something"),
}


@pytest.mark.parametrize("how", KEEPING)
def test_what_a_robots_file_has_started_does_not_keep_the_runner(walk: Path, tmp_path: Path, how: str) -> None:
    path, (starts, name) = robot(tmp_path, SLEEPS, "anywhere", "", 0, ""), KEEPING[how]
    path.write_text(f"{path.read_text()}\n{starts}\n")
    process = run(walk, "--robot", str(path), "--log", str(tmp_path / "answer.csv"), "--yes", "--unpaced")
    said = f"runner.py: {name} of the robot's file was still at work 2 s after the end; it is ended"
    assert (process.returncode, process.stderr) == (0, "")
    assert process.stdout.splitlines()[-1] == said
    assert (tmp_path / "answer.csv").read_text().count("\n") > 10
    for child in tmp_path.glob("*.child"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(child.read_text()), 0)


def test_a_fork_that_outlives_the_runner_does_not_keep_the_lock(walk: Path, tmp_path: Path) -> None:
    path, forks = robot(tmp_path, SLEEPS, "anywhere", "", 0, ""), "import os\nif not os.fork():\n"
    path.write_text(f"{path.read_text()}\n{forks}    os.closerange(0, 3)\n    time.sleep(10)\n    os._exit(0)\n")
    words = (f"--robot={path}", f"--log={tmp_path / 'answer.csv'}", "--yes", "--unpaced")
    assert [run(walk, *words).returncode for _ in range(2)] == [0, 0]


ENDS = """
import sys, threading, time
from pathlib import Path
sys.path.insert(0, "modules")
from gsl.runner import process
PLACE = Path(sys.argv[1])
process.main = lambda folder, words: 0
def say(text):
    raise ValueError("nobody hears")
class Hangs:
    def __del__(self, sleep=time.sleep):
        sleep(1e6)
def keep():
    threading.Thread(target=time.sleep, args=(1e6,)).start()
"""
FINISHES = {
    "main raises": ("def main(*words):\n    keep()\n    1 / 0\nprocess.main = main", "ZeroDivisionError", 1),
    "nobody hears": ("process.say = say; keep()", "", 0),
    "a __del__ hangs": ("late = Hangs()", "", 1),
    "an interrupt": ("import signal\nthreading.Timer(1, signal.raise_signal, [signal.SIGINT]).start(); keep()", "", 0),
}


@pytest.mark.parametrize("how", FINISHES)
def test_the_process_ends_whatever_goes_wrong_at_its_end(walk: Path, tmp_path: Path, how: str) -> None:
    change, words, code = FINISHES[how]
    line = [sys.executable, "-I", "-c", f"{ENDS}{change}\nprocess.run(PLACE, [])", str(tmp_path)]
    done = subprocess.run(line, cwd=walk, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == code and (words in done.stderr if words else done.stderr == "")


def resealed(walk: Path, folder: Path, change: str, value: object) -> Path:
    """A copy of a request with another value in it and a hash that fits."""
    request = json.loads((walk / "request.json").read_text())
    place, *path = request, *change.split(".")
    for key in path[:-1]:
        place = place[int(key) if key.isdigit() else key]
    place[int(path[-1]) if path[-1].isdigit() else path[-1]] = value
    request["hash"] = hash_of(request)
    other = folder / "other"
    other.mkdir()
    (other / "runner.py").write_text((walk / "runner.py").read_text())
    (other / "modules").symlink_to(walk / "modules")
    (other / "request.json").write_text(json.dumps(request))
    return other


NAN, MUCH = float("nan"), 1e9


@pytest.mark.parametrize(
    ("change", "value", "problem"),
    [
        ("limits.upper.3", NAN, "limits.upper[3] is nan, not a finite number"),
        ("episodes.0.posture.0", 10**400, "is damaged: it is not JSON"),
        ("limits.step.3", NAN, "limits.step[3] is nan, not a finite number"),
        ("limits.window", NAN, "limits.window is nan, not a finite number"),
        ("ramp.within", NAN, "ramp.within is nan, not a finite number"),
        ("control_period", NAN, "control_period is nan, not a finite number"),
        ("episodes.0.parameters.0", -float("inf"), "episodes[0].parameters[0] is -inf, not a finite number"),
        ("limits.upper.3", MUCH, "LKneePitch: limits of -0.09233 and 1e+09 rad are those of no joint"),
        ("limits.lower.3", 3.0, "LKneePitch: limits of 3 and 2.113 rad are those of no joint"),
        ("limits.speed.3", MUCH, "LKneePitch: a speed limit of 1e+09 rad/s is that of no joint"),
        ("limits.step.3", MUCH, "LKneePitch: a step of 1e+09 rad or a way of 1.28 rad is more than its speed limit"),
        ("limits.path.3", 5.0, "LKneePitch: a step of 0.1612 rad or a way of 5 rad is more than its speed limit"),
        ("limits.path.3", "far", "limits.path must be 15 finite numbers, one a joint"),
        ("limits.upper", [1.0], "limits.upper must be 15 finite numbers, one a joint"),
        ("limits.window", 1e3, "limits.window is 1000.0, not between 0 and 1 s"),
        ("ramp.seconds", 0.0, "ramp.seconds is 0, not between 1 and 60"),
        ("ramp.speed", 50.0, "ramp.speed is 50, not between 0 and 2"),
        ("ramp.within", MUCH, "ramp.within is 1e+09, not between 0 and 1"),
        ("control_period", 10.0, "control_period is 10 s, not between 0.0001 and 0.1 s"),
        ("control_period", 1e-12, "control_period is 1e-12 s, not between 0.0001 and 0.1 s"),
        ("observes.position", 10**9, "observes.position is 1000000000, not 15 numbers"),
        ("until_fall", 1, "until_fall must be true or false"),
        ("robot", ["nao"], "robot must be a text"),
        ("episodes.0.policy", ["x"], "one: policy must be a name"),
        ("episodes.0.parameters", "x", "one: parameters must be numbers"),
        ("episodes.0.steps", -1, "one: steps is -1, not a whole number from 1 on"),
        ("episodes.0.posture", [0.0], "one: posture must be 15 numbers, one a joint"),
        ("episodes.0.seed", "x", "one: seed is 'x', not a whole number from 0 on"),
        ("episodes", [], "episodes must have different names"),
        ("action_noise", -1.0, "action_noise is -1 rad"),
        ("joints", ["a"] * 15, "joints must be different names"),
        ("ramp", None, "lacks a part or has one of another kind (TypeError"),
    ],
)
def test_a_request_that_cannot_be_meant_is_refused_though_its_hash_fits(
    walk: Path, tmp_path: Path, change: str, value: object, problem: str
) -> None:
    other = resealed(walk, tmp_path, change, value)
    with pytest.raises(ArtifactError) as error:
        read_request(other)
    assert problem in str(error.value) and str(error.value).endswith("; take it anew from where it was made")


def test_the_runner_refuses_limits_that_are_none(walk: Path, tmp_path: Path) -> None:
    other = resealed(walk, tmp_path, "limits.upper.3", NAN)
    for words in (("--dry-run",), (f"--robot={robot(tmp_path, SLEEPS, 'x', 'x', 0, 'x')}", "--yes", "--unpaced")):
        done = run(other, *words)
        assert done.returncode == 2 and "limits.upper[3] is nan" in done.stdout and done.stderr == ""
    assert not (tmp_path / "mine.py.sent").exists()


def own(folder: Path, limits: object) -> Path:
    path = robot(folder, SLEEPS, "nowhere", "x", 0, "x")
    path.write_text(path.read_text() + f"LIMITS = {limits!r}\n")
    return path


def test_the_narrower_of_the_requests_and_the_robots_own_limits_counts(walk: Path, tmp_path: Path) -> None:
    own_limits = {joint: (-0.5, 9.0, 0.5 * speed) for joint, speed in zip(JOINTS, LIMITS["speed"], strict=True)}
    narrow = narrowest(LIMITS, JOINTS, robot_of(own(tmp_path, own_limits)))
    np.testing.assert_allclose(narrow["lower"], np.maximum(LIMITS["lower"], -0.5))
    np.testing.assert_allclose(narrow["upper"], LIMITS["upper"])
    for name in ("speed", "path", "step"):
        np.testing.assert_allclose(narrow[name], 0.5 * np.array(LIMITS[name]))
    assert limits_problem(narrow, JOINTS, PERIOD) == ""


def test_a_target_beyond_the_robots_own_limits_is_not_sent_whatever_the_request_allows(
    walk: Path, tmp_path: Path
) -> None:
    posture = dict(zip(JOINTS, read_request(walk)["episodes"][0]["posture"], strict=True))
    ends = {joint: (-3.0, 3.0) for joint in JOINTS} | {"LKneePitch": (-0.1, posture["LKneePitch"] + 0.02)}
    path = own(tmp_path, ends)
    done = run(walk, f"--robot={path}", f"--log={tmp_path / 'a.csv'}", "--yes", "--unpaced")
    assert "refused: LKneePitch: the target of " in done.stdout and "is above the limit of" in done.stdout
    assert sent(path)[:, JOINTS.index("LKneePitch")].max() <= posture["LKneePitch"] + 0.02 + 1e-9


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ({"LKnee": (-1, 1)}, "LIMITS of the robot's file names 'LKnee', which the request does not"),
        ([1, 2], "LIMITS of the robot's file is no dictionary; it maps joints to lower, upper [rad], speed"),
        ({}, "LIMITS of the robot's file: LHipYawPitch needs finite lower, upper [rad] and speed [rad/s]"),
        (dict.fromkeys(JOINTS, (1, -1)), "LIMITS of the robot's file: LHipYawPitch could not move with 1, -1, inf"),
        (dict.fromkeys(JOINTS, (8, 9)), "LIMITS of the robot's file: LHipYawPitch has no range in common with the re"),
        (dict.fromkeys(JOINTS, (-1, 10**400)), "LIMITS of the robot's file: LHipYawPitch needs finite lower, upper"),
    ],
)
def test_limits_of_the_robot_that_are_none_are_refused(
    walk: Path, tmp_path: Path, limits: object, problem: str
) -> None:
    with pytest.raises(RobotError) as error:
        narrowest(LIMITS, JOINTS, robot_of(own(tmp_path, limits)))
    assert str(error.value).startswith(problem)


def test_the_robot_file_of_a_request_has_its_limits_written_out(walk: Path) -> None:
    assert narrowest(LIMITS, JOINTS, robot_of(walk / "robot.py")) == LIMITS


def test_a_guard_with_limits_that_are_no_numbers_lets_nothing_through() -> None:
    for name in ("lower", "upper", "step", "path"):
        guard = Guard(JOINTS, {**LIMITS, name: [NAN] * 15}, PERIOD)
        guard.start(np.zeros(15))
        assert guard.refusal(np.zeros(15), 0.0)
