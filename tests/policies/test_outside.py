"""Policies that gsl did not make: their wiring, their formats, and what is refused."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from commands import done, forget_modules, gsl, refused

from gsl.core.described import describe, restore
from gsl.core.layout import Layout
from gsl.errors import ConfigError, GslError
from gsl.policies.function import FunctionPolicy
from gsl.policies.onnx import OnnxPolicy
from gsl.policies.outside import Ports
from gsl.policies.signals import turn_back
from gsl.policies.torchscript import TorchScriptPolicy, check_program
from gsl.policies.wired import Eyes, Hands, WiredEnv
from gsl.policies.wiring import Term, Wiring
from gsl.policies.wiring_audit import audit

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.torch.jit:DeprecationWarning")]

JOINTS = ("hip", "knee")
BODY = Layout(JOINTS, {"position": 2, "velocity": 2, "gyro": 3, "base.orientation": 4, "base.velocity": 3}, 0.02)
CART = Layout(("0",), {"state": 4}, 0.02, ranges=((-3.0, 3.0),))
POLE = Layout(("0",), {"state": 4}, 0.02, choices=2)
SEEN = np.array([0.1, 0.2, 1.0, 2.0, 0.3, 0.4, 0.5, 0.0, 0.0, np.sin(0.5), np.cos(0.5), 1.0, 0.0, 0.0])


def terms(*entries: dict[str, Any]) -> tuple[Term, ...]:
    return tuple(Term(**entry) for entry in entries)


def test_a_network_sees_signals_in_its_own_order_scaled_and_from_the_pose() -> None:
    wiring = Wiring(
        observation=terms(
            {"signal": "velocity", "scale": 0.05},
            {"signal": "position", "joints": ("knee", "hip"), "relative": True, "scale": (2.0, 3.0)},
            {"signal": "constant", "values": (0.5, 0.0)},
            {"signal": "gravity"},
        ),
        pose={"knee": 0.7},
    )
    seen = Eyes(wiring, BODY).look(SEEN)
    np.testing.assert_allclose(seen, [0.05, 0.1, 2.0 * (0.2 - 0.7), 3.0 * 0.1, 0.5, 0.0, 0.0, 0.0, -1.0], atol=1e-12)


def test_a_vector_of_the_world_is_turned_into_body_axes() -> None:
    yaw = np.array([0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)])  # the body looks along the world's y
    np.testing.assert_allclose(turn_back(yaw, np.array([0.0, 1.0, 0.0])), [1.0, 0.0, 0.0], atol=1e-12)
    pitched = np.array([0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])  # nose down: gravity pulls forward
    np.testing.assert_allclose(turn_back(pitched, np.array([0.0, 0.0, -1.0])), [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("stacked", "newest", "wanted"),
    [
        ("term", "last", [1, 1, 2, 10, 10, 20]),
        ("term", "first", [2, 1, 1, 20, 10, 10]),
        ("frame", "last", [1, 10, 1, 10, 2, 20]),
        ("frame", "first", [2, 20, 1, 10, 1, 10]),
    ],
)
def test_a_history_is_stacked_as_the_trainer_did(stacked: Any, newest: Any, wanted: list[float]) -> None:
    layout = Layout(("a",), {"position": 1, "velocity": 1}, 0.02)
    eyes = Eyes(Wiring(history=3, stacked=stacked, newest=newest), layout)
    eyes.look(np.array([1.0, 10.0]))
    np.testing.assert_array_equal(eyes.look(np.array([2.0, 20.0])), wanted)


def test_outputs_move_the_joints_that_they_name_from_the_pose_on() -> None:
    wiring = Wiring(joints=("knee",), pose={"hip": -0.3, "knee": 0.6}, scale=0.25, action_limit=2.0)
    np.testing.assert_allclose(Hands(wiring, BODY).act(np.array([4.0])), [-0.3, 0.6 + 0.25 * 2.0])


def test_an_environment_gets_outputs_in_its_own_unit() -> None:
    assert Hands(Wiring(), CART).act(np.array([1.5])) == pytest.approx([0.5])
    assert Hands(Wiring(), CART).act(np.array([9.0])) == pytest.approx([1.0])
    assert Hands(Wiring(), POLE).act(np.array([0.2, 0.7])).tolist() == [1.0]


def test_the_last_action_is_what_the_network_answered() -> None:
    policy = FunctionPolicy(function="policies_here:echo")
    assert policy.names == ()
    wiring = Wiring(observation=terms({"signal": "last_action"}))
    eyes = Eyes(wiring, BODY)
    np.testing.assert_array_equal(eyes.look(SEEN), [0.0, 0.0])
    eyes.episode.last_action = np.array([0.3, -0.3])
    np.testing.assert_array_equal(eyes.look(SEEN), [0.3, -0.3])


@pytest.mark.parametrize(
    ("wiring", "layout", "ports", "message"),
    [
        ({"observation": terms({"signal": "position", "joints": ("nee",)})}, BODY, Ports(None, None), "mean knee"),
        ({"observation": terms({"signal": "foot_force"})}, BODY, Ports(None, None), "does not observe it"),
        ({"joints": ("hip", "hip")}, BODY, Ports(None, None), "names hip twice"),
        ({"pose": {"ankle": 0.1}}, BODY, Ports(None, None), "there is no 'ankle'"),
        ({"scale": (1.0, 2.0, 3.0)}, BODY, Ports(None, None), "has 3 factors for 2 numbers"),
        ({}, BODY, Ports(12, None), "gives 14 numbers .* but the network takes 12"),
        ({}, BODY, Ports(None, 3), "names 2 joints, but the network has 3 outputs"),
        ({}, CART, Ports(4, 1, (np.array([-1.0]), np.array([1.0]))), "of -1 to 1, this world takes -3"),
        ({}, POLE, Ports(4, 1, (np.array([-1.0]), np.array([1.0]))), "acts within a range"),
        ({"pose": {"0": 1.0}}, CART, Ports(None, None), "is for robots"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(wiring: dict[str, Any], layout: Layout, ports: Ports, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as error:
        for finding in audit(Wiring(**wiring), ports, layout):
            finding.insist()
    assert str(error.value).startswith("policy") and "\n" not in str(error.value)


def test_a_single_thing_is_told_as_a_single_thing() -> None:
    layout = Layout(("a",), {"position": 1}, 0.02)
    lines = " ".join(finding.line for finding in audit(Wiring(), Ports(1, 1), layout))
    for thing in ("1 signal", "1 joint", "1 number", "1 output"):
        assert thing in lines and f"{thing}s" not in lines


def test_another_order_of_joints_is_pointed_out_and_the_same_one_is_not() -> None:
    swapped = Wiring(observation=terms({"signal": "position", "joints": ("knee", "hip")}))
    verdicts = {finding.what: finding.verdict for finding in audit(swapped, Ports(2, 2), BODY)}
    assert (verdicts["order"], verdicts["inputs"]) == ("look", "fits")
    both = Wiring(observation=swapped.observation, joints=("knee", "hip"))
    assert {finding.verdict for finding in audit(both, Ports(2, 2), BODY)} == {"fits"}


@pytest.fixture
def network(tmp_path: Path) -> Any:
    import torch

    torch.manual_seed(0)
    module = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.ELU(), torch.nn.Linear(8, 1))
    torch.jit.script(module).save(str(tmp_path / "net.pt"))
    return module


def answer(network: Any, seen: np.ndarray) -> float:
    import torch

    return float(network(torch.tensor(seen, dtype=torch.float32)[None]).detach()[0, 0])


def test_torchscript_acts_as_the_module_does_and_offsets_are_added(network: Any, tmp_path: Path) -> None:
    policy = TorchScriptPolicy(file=str(tmp_path / "net.pt")).size_for(CART)
    assert policy.names == ("offset.0",)
    seen = np.array([0.1, -0.2, 0.3, 0.4])
    plain, shifted = (policy.start(np.array([offset]), CART).act(seen)[0] for offset in (0.0, 0.25))
    assert plain == pytest.approx(answer(network, seen) / 3.0, rel=1e-5)
    assert shifted == pytest.approx(plain + 0.25)
    again = restore(describe(policy))
    assert describe(again) == describe(policy)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_onnx_acts_as_the_module_does(network: Any, tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    import torch

    torch.onnx.export(network, (torch.zeros(1, 4),), str(tmp_path / "net.onnx"), dynamo=False)
    policy = OnnxPolicy(file=str(tmp_path / "net.onnx")).size_for(CART)
    seen = np.array([0.1, -0.2, 0.3, 0.4])
    assert policy.start(policy.initial, CART).act(seen)[0] == pytest.approx(answer(network, seen) / 3.0, rel=1e-5)
    with pytest.raises(ConfigError, match="but the network takes 4"):
        policy.size_for(BODY)


def test_a_module_with_a_memory_begins_anew_in_every_episode(tmp_path: Path) -> None:
    import torch

    class Counter(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.register_buffer("count", torch.zeros(1))

        def forward(self, seen: torch.Tensor) -> torch.Tensor:
            self.count += 1
            return self.count[None] + 0.0 * seen[:, :1]

        @torch.jit.export
        def reset(self) -> None:
            self.count.zero_()

    torch.jit.script(Counter()).save(str(tmp_path / "memory.pt"))
    policy = TorchScriptPolicy(file=str(tmp_path / "memory.pt"), wiring=Wiring(scale=0.3)).size_for(CART)
    for _ in range(2):
        run = policy.start(policy.initial, CART)
        assert [run.act(np.zeros(4))[0] for _ in range(3)] == pytest.approx([0.1, 0.2, 0.3])


FUNCTIONS = """
import numpy as np

def act(seen):
    return -seen[2:3]

def broken(seen):
    return np.array([np.nan])

def wide(seen):
    return np.zeros(3)

class Counting:
    def __init__(self):
        self.count = 0
    def __call__(self, seen):
        self.count += 1
        return np.array([0.3 * self.count])
"""


def test_a_function_acts_and_a_class_has_a_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "policies_there.py").write_text(FUNCTIONS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))

    def run(name: str) -> Any:
        policy = FunctionPolicy(function=f"policies_there:{name}").size_for(CART)
        return policy.start(policy.initial, CART)

    assert run("act").act(np.array([0.0, 0.0, 0.6, 0.0]))[0] == pytest.approx(-0.2)
    counting = run("Counting")
    assert [counting.act(np.zeros(4))[0] for _ in range(2)] == pytest.approx([0.1, 0.2])
    with pytest.raises(GslError, match="policies_there:broken: output 0 is not finite"):
        run("broken").act(np.zeros(4))
    with pytest.raises(GslError, match="returns 3 numbers; the wiring has 1 output"):
        run("wide").act(np.zeros(4))
    with pytest.raises(ConfigError, match="cannot be loaded"):
        run("nobody")


class Walked(gymnasium.Env[np.ndarray, np.ndarray]):
    """An environment of gsl's, whose observation is the sum of its actions."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.place = np.zeros(4)
        return self.place, {}

    def step(self, action: np.ndarray) -> Any:
        self.place = self.place + action
        return self.place, 0.0, False, False, {}


def test_a_trainer_sees_what_the_policy_will_see_and_acts_as_it_will() -> None:
    wiring = Wiring(observation=terms({"signal": "state", "joints": ("1",)}, {"signal": "last_action"}), scale=2.0)
    env = WiredEnv(Walked(), wiring, CART)
    assert isinstance(env.action_space, gymnasium.spaces.Box)
    assert (env.action_space.low[0], env.action_space.high[0]) == (-1.5, 1.5)
    env.reset()
    seen, *_ = env.step(np.array([0.75]))
    np.testing.assert_allclose(seen, [0.5, 0.75])  # 2 · 0.75 of 3 is half a range


LINES = (
    *('torch.save(x, "ran")', 'torch . save (x, "ran")', 'torch.from_file("ran", True, 16)', 'ops.aten.save(x, "ran")'),
    *(
        'getattr(torch, "sa" "ve")',
        'getattr(torch, "save")',
        r'getattr(torch, "\x73ave")',
        'print("\\x1b[2J")',
        "ops.profiler._record_function_exit(x)",
        "rpc_async(x)",
    ),
)


@pytest.mark.parametrize("line", LINES)
def test_a_program_that_could_reach_files_is_refused_before_it_is_loaded(line: str, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    layers = torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.Sequential(torch.nn.ELU()), torch.nn.LSTM(4, 2))
    torch.jit.script(layers).save(str(tmp_path / "good.pt"))
    with (tmp_path / "good.pt").open("rb") as file:
        check_program(tmp_path / "good.pt", file)
    with zipfile.ZipFile(tmp_path / "good.pt") as good, zipfile.ZipFile(tmp_path / "bad.pt", "w") as bad:
        for entry in good.infolist():
            bad.writestr(entry.filename, good.read(entry))
        bad.writestr("bad/code/__torch__/data/x.py", f"def f(x: Tensor) -> None:\n  {line}\n")
    with pytest.raises(ConfigError, match="could reach files"):
        TorchScriptPolicy(file=str(tmp_path / "bad.pt")).network()


def test_a_network_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    """What the archive says of itself counts: to write such a file in earnest takes seconds."""
    with zipfile.ZipFile(tmp_path / "bomb.pt", "w") as archive:
        archive.writestr("x/data/0", b"")
        archive.infolist()[0].file_size = 2_100_000_000
    with pytest.raises(ConfigError, match="unpacks to more than 2 GB"):
        TorchScriptPolicy(file=str(tmp_path / "bomb.pt")).network()


def test_files_that_are_no_networks_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "net.pt").write_text("no network", encoding="utf-8")
    base = ("collect", "world=inverted_pendulum", "task=own_reward")
    assert "is no TorchScript" in refused(*base, "policy=torch", "policy.file=net.pt", folder=tmp_path)
    assert "is no file" in refused(*base, "policy=torch", "policy.file=other.pt", folder=tmp_path)
    said = refused(*base, "policy=sb3", "policy.file=net.pt", folder=tmp_path)
    assert "say trust=stable_baselines3 if you know where it comes from" in said
    trusted = ("policy=sb3", "policy.file=net.pt", "trust=stable_baselines3")
    assert "is no policy of Stable-Baselines3" in refused(*base, *trusted, folder=tmp_path)
    said = refused(*base, "policy=python", "policy.function=act", folder=tmp_path)
    assert said.startswith("policy.function = act")


@pytest.mark.parametrize(
    ("function", "said"),
    [
        ("blank", "output 0 is not finite"),
        ("two", "returns 2 numbers; the wiring has 1 output"),
        ("nothing", "returns 0 numbers"),
        ("word", "returns no array of numbers but str"),
    ],
)
def test_a_function_that_returns_nonsense_is_refused_by_the_audit_and_by_an_episode(
    function: str, said: str, tmp_path: Path
) -> None:
    answers = {"blank": [float("nan")], "two": [0.0, 0.0], "nothing": None, "word": "left"}
    lines = [f"def {name}(seen):\n    return {answer!r}\n" for name, answer in answers.items()]
    (tmp_path / "nonsense.py").write_text("nan = float('nan')\n" + "".join(lines))
    base = ("world=inverted_pendulum", "policy=python", f"policy.function=nonsense:{function}")
    audited = gsl("wiring", *base, folder=tmp_path)
    assert audited.code == 2 and said in " ".join(audited.out.split())
    assert said in gsl("collect", *base, "task=own_reward", "workers=1", folder=tmp_path).err
    forget_modules(tmp_path)


def test_a_network_that_makes_choices_is_evaluated_and_cannot_be_searched(tmp_path: Path) -> None:
    (tmp_path / "choosing.py").write_text("def act(seen):\n    return [0.0]\n")
    base = ("world=cliff_walking", "policy=python", "policy.function=choosing:act", "task=own_reward")
    few = ("policies=null", "episodes=2", "check=2", "confirmation=2", "workers=1")
    assert "π0 alone was measured" in done("evaluate", *base, *few, folder=tmp_path).out
    said = refused("optimize", *base, "grounding=none", folder=tmp_path)
    assert said.startswith("policy = FunctionPolicy: has no parameters")


def test_commands_point_out_another_order_of_joints(tmp_path: Path) -> None:
    (tmp_path / "still.py").write_text("def act(seen):\n    return 6 * [0.0]\n")
    order = "[Pitch,Rotation,Elbow,Wrist_Pitch,Wrist_Roll,Jaw]"
    base = ("world=so101", "task=excite", "policy=python", "policy.function=still:act")
    few = ("episodes=1", "task.duration=1", "workers=1")
    said = done("collect", *base, *few, f"policy.wiring.joints={order}", folder=tmp_path)
    assert "warning: policy.wiring.observation.0.joints: position has Rotation where" in said.err


def test_a_brought_policy_is_collected_with_searched_and_evaluated(network: Any, tmp_path: Path) -> None:
    base = ("world=inverted_pendulum", "task=own_reward", "policy=torch", "policy.file=net.pt", "workers=1", "name=net")
    done("collect", *base, "episodes=2", "neighbours=1", folder=tmp_path)
    small = ("grounding=none", "optimizer.candidates=4", "optimizer.generations=1", "rollouts=1")
    done("optimize", *base, *small, folder=tmp_path)
    done("evaluate", *base, "episodes=2", "check=2", "confirmation=2", folder=tmp_path)
    said = done(
        "evaluate", *base, "policies=null", "episodes=2", "check=2", "confirmation=2", "out=alone", folder=tmp_path
    )
    assert "π0, fresh" in said.out


def test_the_wiring_is_shown_and_a_wrong_one_exits_with_2(network: Any, tmp_path: Path) -> None:
    base = ("wiring", "policy=torch", "policy.file=net.pt")
    said = done(*base, "world=inverted_pendulum", folder=tmp_path)
    assert "the network takes 4 numbers: state 4" in said.out and "the wiring fits" in said.out
    wrong = gsl(*base, "world=so101", folder=tmp_path)
    assert wrong.code == 2 and "the policy would be refused" in wrong.out
    assert "policy = Linear: a policy of gsl's own has no wiring" in refused("wiring", "policy=linear", folder=tmp_path)
