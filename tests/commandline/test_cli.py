"""The command line as a process: light to start, and it leaves cleanly."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SUPPORT = Path(__file__).parents[1] / "support"
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if not name.startswith(("GSL_", "COMP_", "_"))},
    "PYTHONPATH": str(SUPPORT),
    "GSL_CONFIG_DIR": str(SUPPORT / "conf_example"),
    "GSL_TRUST": "example_stage",
    "NO_COLOR": "1",
}
HEAVY = {
    "hydra",
    "omegaconf",
    "numpy",
    "scipy",
    "torch",
    "pandas",
    "pyarrow",
    "pydantic",
    "rich",
    "matplotlib",
    "joblib",
}


def gsl(*arguments: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gsl", *arguments],
        cwd=cwd,
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    program = "import sys; from gsl.cli import call; call(['--help']); print(*sorted(sys.modules), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60
    )
    assert "train-forward" in done.stdout
    assert HEAVY & set(done.stderr.split()) == set()


def test_a_command_runs_as_a_process(tmp_path: Path) -> None:
    done = gsl("collect", "episodes=2", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("runs/example/collect\n")
    listed = gsl("runs", cwd=tmp_path)
    assert "example/collect " in listed.stdout


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_stage_and_leaves_nothing_half_written(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-m", "gsl", "collect", "fails=slow"]
    process = subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == "working\n"
    begin = time.monotonic()
    process.send_signal(number)
    _, said = process.communicate(timeout=20)
    assert (process.returncode, said) == (
        130,
        "gsl collect: interrupted; what is complete stays, and the same command does the rest\n",
    )
    assert time.monotonic() - begin < 10
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    done = subprocess.run(
        f"{sys.executable} -m gsl collect --help | head -n 1",
        shell=True, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["gsl", "collect", "world", "=", "nao_w"], {"nao_weak", "nao_weak_uneven", "nao_worn"}),
        (["gsl", "collect", "world", "=", "wo"], {"worn"}),
        (["gsl", "collect", "world", "=", "id"], {"ideal"}),
        (["gsl", "evaluate", "real", "=", "id"], {"ideal"}),
        (["gsl", "collect", "epi"], {"episodes=", "episodes=3"}),
    ],
)
def test_bash_completes_groups_options_and_settings(tmp_path: Path, words: list[str], expected: set[str]) -> None:
    done = gsl(cwd=tmp_path, COMP_WORDS="\n".join(words), COMP_CWORD=str(len(words) - 1), _GSL_COMPLETE="complete_bash")
    assert set(done.stdout.split()) == expected
    assert done.stderr == ""


def test_jobs_run_side_by_side_with_another_launcher(tmp_path: Path) -> None:
    pytest.importorskip("hydra_plugins.hydra_joblib_launcher")
    done = gsl("collect", "-m", "seed=1,2", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "runs/example").iterdir()) == ["seed=1", "seed=2"]


def test_what_an_environment_prints_stays_out_of_the_document(tmp_path: Path) -> None:
    (tmp_path / "chatty.py").write_text(
        "import os\n"
        "from gymnasium.envs.classic_control import PendulumEnv\n\n"
        "class Chatty(PendulumEnv):\n"
        "    def reset(self, **more):\n"
        "        self.rows = 0\n"
        "        return super().reset(**more)\n\n"
        "    def step(self, action):\n"
        "        print('a step')\n"
        "        os.write(1, b'and one of C\\n')\n"
        "        self.rows += 1\n"
        "        observation, reward, _, _, about = super().step(action)\n"
        "        return observation, reward, False, self.rows >= 20, about\n"
    )
    environment = {name: value for name, value in ENVIRONMENT.items() if not name.startswith("GSL_")}
    words = (
        *("collect", "world=gymnasium", "world.env_id=chatty:Chatty", "trust=chatty", "task=own_reward", "policy=mlp"),
        *("policy.hidden=[]", "episodes=1", "neighbours=0", "workers=1", "name=x", "--json"),
    )
    done = subprocess.run(
        [sys.executable, "-m", "gsl", *words],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["metrics"]["episodes"] == 1
    assert "a step" in done.stderr and "and one of C" in done.stderr
