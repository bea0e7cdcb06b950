"""Whatever a user gives that does not fit is one line (what, where, what to do), and leaves nothing behind."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import SMALL, gsl, refused
from safetensors import safe_open
from safetensors.numpy import save

pytestmark = pytest.mark.slow

LINEAR = ("train-forward", "model=linear")
GAT = ("optimize", *SMALL, "grounding=gat", "grounding.inverse_model=chain", "accept=true")


ARM = "experiment=arm preset=toy grounding=gat"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("collect episode=3", "episode: no such setting; did you mean episodes?"),
        ("collect task=excite motion=3", "motion: no such setting; did you mean policy.motions?"),
        ("collect preset.motion=3", "preset.motion: nothing in gsl collect refers to it here"),
        ("collect world.stp=0.1", "world.stp: no such setting; did you mean world.step"),
        (
            "collect task=walc",
            "no task called walc; did you mean walk? There is arm, distance, excite, own_reward, walk",
        ),
        ("collect preset=", "no preset called (nothing); there is "),
        ("collect =3", "'=3': names no setting; write key=value"),
        ("collect episodes=four", "episodes = four: must be a whole number"),
        ("collect episodes=true", "episodes = true: must be a number"),
        (f"collect seed={2**63}", f"seed = {2**63}: must be at most 9.22337e+18"),
        (f"collect world.iterations={2**31}", f"world.iterations = {2**31}: must be at most 10000"),
        ("collect world.settle=1e12", "world.settle = 1000000000000.0: must be at most 600 (s)"),
        ("collect episodes=null", "episodes = null: must be a whole number"),
        ("collect task.duration=nan", "task.duration = nan: must be a finite number (s)"),
        ("collect task.duration=-1", "task.duration = -1: must be above 0 (s)"),
        ("collect task.duration=0.001", "task.duration = 0.001: must be at least one control period (0.02 s)"),
        ("collect world.step=0.003", "world.period: 0.02 s is not a multiple of the physics step 0.003 s"),
        ("collect world.step=1e-12", "world.step = 1e-12: must be at least 1e-05 (s)"),
        ("collect world.robot=pepper", "world.robot: no robot called 'pepper'; there is go2, nao, pendulum"),
        ("collect workers=0", "workers = 0: must not be 0; -1 is one process a core"),
        ("collect workers=1000000", "workers = 1000000: must be at most 1024"),
        ("collect name=../mine", "name = ../mine: must be a name in runs/"),
        ("collect out=", "out: must not be empty"),
        ("collect experiment=arm", "experiment = arm: is not for gsl collect, which cannot take its "),
        ("compare experiment=arm", "experiment = arm: is not for gsl compare, which cannot take its task"),
        ("collect world.effects.torque_limit.factor=-1", "world.effects.torque_limit.factor = -1: must be above 0"),
        ("optimize grounding.alpha=2", "grounding.alpha = 2: must be at most 1, or one of 'auto'"),
        ("optimize grounding.alpha=all", "grounding.alpha = all: must be a number, or one of 'auto'"),
        ("optimize optimizer.candidates=2", "optimizer.candidates = 2: must be at least 4"),
        ("evaluate policies=nothing", "nothing: there is no such path and no such run in runs"),
        ("evaluate confirmation=1", "confirmation = 1: must be at least 2"),
        ("train-inverse data=nothing", "nothing: there is no such path and no such run in runs"),
        (f"iterate {ARM} inverse_model.variables=all", "inverse_model.variables: has to name the joints that forward_"),
        (f"iterate {ARM} grounding.x=[LKneePitch]", "grounding.x = LKneePitch: the models know no joint of this name"),
        (
            f"iterate {ARM} forward_model.variables=[LKnePitch]",
            "forward_model.variables = LKnePitch: the robot has no ",
        ),
        ("compare +world@worlds.mine=robot rank=true", "rank = true: needs worlds that are simulated"),
        ("iterate world=nao_worn", "world: has a role here; say real=... or sim=..."),
    ],
)
def test_a_setting_that_does_not_fit(arguments: str, line: str, tmp_path: Path) -> None:
    assert refused(*arguments.split(), folder=tmp_path).startswith(line)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            ("evaluate", "policies=chain/optimise"),
            "there is no such path and no such run in runs, did you mean chain/opt",
        ),
        (("evaluate", "policies=chain/collect_real"), "runs/chain/collect_real: holds collect, which has no policies"),
        (("evaluate", "policies=chain/optimize", "policy=linear"), "runs/chain/optimize: its policies are others: "),
        (
            ("train-forward", "data=chain/optimize"),
            "runs/chain/optimize: holds optimize, but collect or import is needed",
        ),
        (
            ("export", "trajectories=chain", "format=csv"),
            "several artifacts fit, name one of them: chain/collect_real, chain/collect_sim",
        ),
        ((*GAT, "grounding.forward_model=chain/train_inverse"), "holds train_inverse, but train_forward is needed"),
    ],
)
def test_an_artifact_that_is_missing_or_foreign(arguments: tuple[str, ...], line: str, chain: Path) -> None:
    assert line in refused(*arguments, "out=runs/refused", folder=chain)


def test_sizes_that_no_array_has_are_too_much_memory(tmp_path: Path) -> None:
    said = gsl("optimize", *SMALL, "grounding=none", f"rollouts={10**18}", folder=tmp_path)
    assert said.code == 1 and "there is not enough memory for this" in said.lines[-1]


def test_an_artifact_of_another_version_is_named(chain: Path) -> None:
    manifest = chain / "runs/chain/optimize/manifest.json"
    whole = manifest.read_text()
    manifest.write_text(whole.replace('"schema_version": 2', '"schema_version": 9'))
    try:
        line = refused("evaluate", "policies=chain/optimize", "out=runs/refused", folder=chain)
    finally:
        manifest.write_text(whole)
    assert line == "runs/chain/optimize/manifest.json: schema_version 9 is unknown; this gsl reads 2"


@pytest.fixture
def rewritten(chain: Path) -> Iterator[Callable[..., str]]:
    """Write the chain's real trajectories anew with other columns or metadata, and return the file's name."""
    source, target = chain / "runs/chain/collect_real/trajectories.parquet", chain / "given.parquet"
    table = pq.read_table(source)
    about = json.loads(table.schema.metadata[b"gsl"])

    def write(change: Callable[[pa.Table], pa.Table] = lambda table: table, **metadata: object) -> str:
        pq.write_table(change(table).replace_schema_metadata({"gsl": json.dumps(about | metadata)}), target)
        return target.name

    yield write
    target.unlink()


def test_a_truncated_log(chain: Path, rewritten: Callable[..., str]) -> None:
    file = chain / rewritten()
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    line = refused(*LINEAR, "data=given.parquet", "out=runs/refused", folder=chain)
    assert line == "given.parquet: is not a parquet file, or truncated or damaged; copy or collect it again"


def test_a_log_with_nan(chain: Path, rewritten: Callable[..., str]) -> None:
    def change(table: pa.Table) -> pa.Table:
        values = table["position.LKneePitch"].to_numpy().copy()
        values[17] = np.nan
        return table.set_column(table.column_names.index("position.LKneePitch"), "position.LKneePitch", [values])

    line = refused(*LINEAR, f"data={rewritten(change)}", "out=runs/refused", folder=chain)
    assert line == "given.parquet, column position.LKneePitch, row 17: is not a finite number; drop or mend the row"


def _with_elbows(table: pa.Table) -> pa.Table:
    return table.rename_columns([name.replace("LKneePitch", "LElbowRoll") for name in table.column_names])


def test_a_log_of_joints_that_the_robot_does_not_have(chain: Path, rewritten: Callable[..., str]) -> None:
    joints = [joint.replace("LKneePitch", "LElbowRoll") for joint in _joints(chain)]
    line = refused(*LINEAR, f"data={rewritten(_with_elbows, joints=joints)}", "out=runs/refused", folder=chain)
    assert line == "given.parquet, column position.LElbowRoll: the nao has no such joint"


def test_a_model_of_another_robot(chain: Path, rewritten: Callable[..., str], tmp_path: Path) -> None:
    joints = [joint.replace("LKneePitch", "LElbowRoll") for joint in _joints(chain)]
    data = rewritten(_with_elbows, joints=joints, robot="mine", role="imported")
    for stage in ("train-forward", "train-inverse"):
        assert gsl(stage, f"data={data}", "model=linear", f"out={tmp_path / stage}", folder=chain).code == 0
    models = (f"grounding.forward_model={tmp_path}/train-forward", f"grounding.inverse_model={tmp_path}/train-inverse")
    line = refused(*GAT, *models, "out=runs/refused", folder=chain)
    assert line == "grounding: its models know joints that the world lacks: LElbowRoll"


def test_a_model_of_another_control_period(chain: Path, rewritten: Callable[..., str], tmp_path: Path) -> None:
    data = rewritten(control_period=0.01)
    assert gsl(*LINEAR, f"data={data}", f"out={tmp_path / 'fast'}", folder=chain).code == 0
    line = refused(*GAT, f"grounding.forward_model={tmp_path / 'fast'}", "out=runs/refused", folder=chain)
    assert "fast/heldout.parquet: " in line and "control period of 0.01 s, not the world's 0.02 s" in line


def _joints(chain: Path) -> list[str]:
    table = pq.read_schema(chain / "runs/chain/collect_real/trajectories.parquet")
    joints: list[str] = json.loads(table.metadata[b"gsl"])["joints"]
    return joints


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            lambda about, arrays: (about | {"schema_version": 2}, arrays),
            "schema_version 2 is unknown; this gsl reads 1",
        ),
        (
            lambda about, arrays: (about | {"kind": "inverse_model"}, arrays),
            "holds inverse_model, but forward_model is",
        ),
        (lambda about, arrays: (about, dict([*arrays.items()][1:])), "lacks part of the model"),
        (lambda about, arrays: (about, {n: a * np.nan for n, a in arrays.items()}), "a number that is not finite"),
        (None, "is not a checkpoint, or truncated or damaged; train the model again"),
    ],
    ids=["version", "kind", "part", "nan", "truncated"],
)
def test_a_checkpoint_that_does_not_fit(change: Callable[..., tuple] | None, line: str, chain: Path) -> None:
    source, target = chain / "runs/chain/train_forward/forward_model.safetensors", chain / "given.safetensors"
    with safe_open(source, framework="numpy") as file:
        about, arrays = (
            json.loads(file.metadata()["gsl"]),
            {name: file.get_tensor(name) for name in sorted(file.keys())},
        )
    if change is None:
        target.write_bytes(source.read_bytes()[:-40])
    else:
        about, arrays = change(about, arrays)
        target.write_bytes(save(arrays, metadata={"gsl": json.dumps(about)}))
    said = refused(*GAT, "grounding.forward_model=given.safetensors", "out=runs/refused", folder=chain)
    target.unlink()
    assert said.startswith("given.safetensors: ") and line in said


def test_a_damaged_artifact(chain: Path) -> None:
    checkpoint = chain / "runs/chain/train_forward/forward_model.safetensors"
    whole = checkpoint.read_bytes()
    checkpoint.write_bytes(whole[:-40])
    try:
        line = refused(*GAT, "grounding.forward_model=chain", "out=runs/refused", folder=chain)
    finally:
        checkpoint.write_bytes(whole)
    assert line.startswith("runs/chain/train_forward/forward_model.safetensors: is not as the manifest says; ")


@pytest.mark.parametrize("force", ["false", "true"])
def test_a_folder_that_is_somebody_elses(force: str, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("years of work")
    line = refused("collect", *SMALL, "out=mine", f"force={force}", folder=tmp_path)
    assert line == "mine: exists and is no artifact of gsl; move it away or choose another out="
    assert (tmp_path / "mine/thesis.txt").read_text() == "years of work"


def test_a_run_folder_below_a_file(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("a file where the folder should be")
    line = refused("collect", *SMALL, folder=tmp_path)
    assert line.startswith("runs/quick-start/collect_real: there can be no folder here")
    assert line.endswith("choose another out=")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Mount a file system in memory with the given options."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(options: str) -> Path:
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], capture_output=True)
        if done.returncode:
            pytest.skip("mounting needs more rights")
        return place

    yield mount
    subprocess.run(["umount", place], capture_output=True)


@pytest.mark.parametrize(
    "command", ["collect", "train-forward data=chain/collect_real model=linear", "evaluate policies=chain/optimize"]
)
def test_a_full_disk(command: str, chain: Path, disk: Callable[[str], Path]) -> None:
    place = disk("size=4k")
    sizes = () if command.startswith("train") else SMALL
    line = refused(*command.split(), *sizes, f"out={place / 'it'}", folder=chain, code=1)
    assert line.startswith(f"{place}: cannot be written: ") and "free space or choose another folder with out=" in line
    assert list(place.iterdir()) == []


def test_a_disk_that_can_only_be_read(tmp_path: Path, disk: Callable[[str], Path]) -> None:
    place = disk("ro,size=1m")
    line = refused("collect", *SMALL, f"out={place / 'it'}", folder=tmp_path, code=1)
    assert line.startswith(f"{place}: cannot be written: Read-only file system")
    assert gsl("robot", "nao", f"out={place / 'robot'}", folder=tmp_path).code == 1
