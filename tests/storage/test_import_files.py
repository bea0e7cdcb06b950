"""The same motion out of files of every program: tensors, HDF5, MATLAB, numpy, pairs of files, coarse clocks."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import done, gsl, refused

from gsl.core.trajectory import Batch
from gsl.storage.importers.sizes import DAMAGED
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

JOINTS = ("shoulder", "elbow")
TIME = 0.01 * np.arange(301)


def waves(time: np.ndarray) -> np.ndarray:
    return np.column_stack([0.5 * np.sin(2.0 * np.pi * 0.7 * time), 0.3 + 0.4 * np.sin(2.0 * np.pi * 1.1 * time)])


ACTION, POSITION = waves(TIME), waves(TIME - 0.05)
ARRAYS = {"time": TIME, "des_dof_pos": ACTION, "dof_pos": POSITION}


def mapping(folder: Path, action: Any = "des_dof_pos", position: Any = "dof_pos", **more: Any) -> str:
    mapping = {"joints": list(JOINTS), "signals": {"action": action, "position": position}, **more}
    (folder / "m.yaml").write_text(yaml.safe_dump(mapping, sort_keys=False))
    return "mapping=m.yaml"


def imported(folder: Path, source: str, *more: str) -> Batch:
    done("import", f"source={source}", "name=log", "force=true", *more, folder=folder)
    return read(folder / "runs/log/import/trajectories.parquet")


def check_same(batch: Batch, episodes: int = 1, tolerance: float = 1e-9) -> None:
    assert batch.joints == JOINTS and len(batch.episodes) == episodes
    for episode in batch.episodes:
        np.testing.assert_allclose(episode.time, TIME, atol=tolerance)
        np.testing.assert_allclose(episode.action, ACTION[:-1], atol=tolerance)
        np.testing.assert_allclose(episode.position, POSITION, atol=tolerance)


def test_saved_tensors_are_read_flat_or_nested(tmp_path: Path) -> None:
    import torch

    tensors = {name: torch.tensor(values) for name, values in ARRAYS.items()}
    torch.save({**tensors, "kp": 20.0, "name": "chirp"}, tmp_path / "chirp.pt")
    check_same(imported(tmp_path, "chirp.pt", mapping(tmp_path, name="{name} {kp}")))
    check_same(imported(tmp_path, "chirp.pt", "mapping=pace", "mapping.joints=[shoulder,elbow]"))
    torch.save({"run": tensors}, tmp_path / "nested.pt")
    chosen = mapping(tmp_path, "run.des_dof_pos", "run.dof_pos", time="run.time")
    check_same(imported(tmp_path, "nested.pt", chosen))


def test_tensors_come_without_the_code_of_their_pickle(tmp_path: Path) -> None:
    import torch

    class Trap:
        def __reduce__(self) -> Any:
            return Path.touch, (tmp_path / "ran",)

    torch.save({**{name: torch.tensor(values) for name, values in ARRAYS.items()}, "trap": Trap()}, tmp_path / "a.pt")
    (tmp_path / "b.pt").write_bytes(pickle.dumps({"time": Trap()}))
    (tmp_path / "c.pt").write_bytes(b"PK\x03\x04 nothing")
    for name in ("a", "b"):
        line = refused("import", f"source={name}.pt", mapping(tmp_path), folder=tmp_path)
        assert line.startswith(f"{name}.pt: holds more than tensors (a pickle, which can run code)")
    line = refused("import", "source=c.pt", mapping(tmp_path), folder=tmp_path)
    assert line == f"c.pt: is no file of torch.save, or {DAMAGED}"
    assert not (tmp_path / "ran").exists()


def test_a_tensor_that_is_stretched_over_nothing_is_refused_by_its_size(tmp_path: Path) -> None:
    import torch

    torch.save({"time": torch.zeros(1).expand(10**11), "des_dof_pos": torch.zeros(1, 2)}, tmp_path / "a.pt")
    assert "would need about" in refused("import", "source=a.pt", mapping(tmp_path, position="time"), folder=tmp_path)


def test_matrices_of_matlab_are_read_and_fields_of_structs(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", {**ARRAYS, "time": TIME[None, :], "kp": 20.0})  # a row, as MATLAB makes them
    check_same(imported(tmp_path, "log.mat", mapping(tmp_path, about={"kp": "{kp}"})))
    savemat(tmp_path / "struct.mat", {"run": {"t": TIME, "q": POSITION, "goal": ACTION}}, do_compression=True)
    check_same(imported(tmp_path, "struct.mat", mapping(tmp_path, "run.goal", "run.q", time="run.t")))
    (tmp_path / "bad.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    line = refused("import", "source=bad.mat", mapping(tmp_path), folder=tmp_path)
    assert line == f"bad.mat: is no MATLAB file, or {DAMAGED}"


def test_npy_files_are_one_episode_together_or_a_table_alone(tmp_path: Path) -> None:
    for name in ("ep1", "ep2"):
        (tmp_path / "logs" / name).mkdir(parents=True)
        for key, values in ARRAYS.items():
            np.save(tmp_path / "logs" / name / f"{key}.npy", values)
    check_same(imported(tmp_path, "logs/ep1", mapping(tmp_path)))
    check_same(imported(tmp_path, "logs", mapping(tmp_path, files="ep*")), episodes=2)
    np.save(tmp_path / "all.npy", np.column_stack([TIME, ACTION, POSITION]))
    chosen = mapping(tmp_path, [1, 2], [3, 4], time="0")
    check_same(imported(tmp_path, "all.npy", chosen))
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    assert "one npy file is a table of rows and columns" in refused(
        "import", "source=objects.npy", chosen, folder=tmp_path
    )


def test_hdf5_without_its_library_says_what_to_install(tmp_path: Path) -> None:
    try:
        import h5py  # noqa: F401
    except ImportError:
        (tmp_path / "a.hdf5").write_bytes(b"\x89HDF\r\n\x1a\n")
        line = refused("import", "source=a.hdf5", mapping(tmp_path), folder=tmp_path)
        assert line == "a.hdf5: HDF5 files are read with the library h5py: pip install 'gsl[hdf5]'"


def test_hdf5_is_read_a_file_an_episode_or_a_group_an_episode(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "episode_0.hdf5", "w") as file:  # as ALOHA's are
        file["observations/qpos"], file["action"] = POSITION, ACTION
        file["observations/images/top"] = np.zeros((301, 4, 4, 3), np.uint8)
        file.attrs["sim"] = False
    chosen = mapping(tmp_path, "action", "observations/qpos", time={"period": 0.01}, about={"sim": "{sim}"})
    check_same(imported(tmp_path, "episode_0.hdf5", chosen))
    with h5py.File(tmp_path / "aloha.hdf5", "w") as file:
        ramps = np.sin(TIME)[:, None] * np.linspace(0.1, 0.5, 14)
        file["observations/qpos"], file["action"] = ramps, ramps
    aloha = imported(tmp_path, "aloha.hdf5", "mapping=aloha")
    np.testing.assert_allclose(aloha.episodes[0].position, np.delete(ramps, [6, 13], axis=1))
    with h5py.File(tmp_path / "demos.h5", "w") as file:  # as robomimic's are
        for index in (0, 10, 2):
            demo = file.create_group(f"data/demo_{index}")
            demo["actions"], demo["obs/joint_pos"] = ACTION, POSITION
        file["elsewhere"] = h5py.ExternalLink(str(tmp_path / "episode_0.hdf5"), "/action")
    chosen = mapping(tmp_path, "actions", "obs/joint_pos", records="data/demo_*", time={"period": 0.01})
    batch = imported(tmp_path, "demos.h5", chosen)
    check_same(batch, episodes=3)
    names = [entry["file"] for entry in batch.metadata["episodes"]]
    assert names == [f"demos/data/demo_{k}" for k in (0, 2, 10)]
    chosen = mapping(tmp_path, "elsewhere", "data/demo_0/obs/joint_pos", time={"period": 0.01})
    assert "column elsewhere: is missing" in refused("import", "source=demos.h5", chosen, folder=tmp_path)
    with h5py.File(tmp_path / "m.mat", "w", userblock_size=512) as file:  # as MATLAB 7.3 stores: columns first
        file["time"], file["des_dof_pos"], file["dof_pos"] = TIME[:, None], ACTION.T, POSITION.T
    check_same(imported(tmp_path, "m.mat", mapping(tmp_path)))


def table(values: np.ndarray) -> str:
    rows = (",".join(map(str, row)) for row in np.column_stack([TIME, values]))
    return "\n".join(["t,j0,j1", *rows]) + "\n"


def test_two_files_an_episode_are_paired_by_what_their_names_share(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    for name in ("ep1", "ep2"):
        (tmp_path / f"logs/{name}_cmd.csv").write_text(table(ACTION))
        (tmp_path / f"logs/{name}_state.csv").write_text(table(POSITION))
    signals = {"action": {"file": "cmd", "column": ["j0", "j1"]}, "position": {"file": "state", "column": ["j0", "j1"]}}
    chosen = mapping(tmp_path, **signals, files={"cmd": "*_cmd.csv", "state": "*_state.csv"}, time="t")
    batch = imported(tmp_path, "logs", chosen)
    check_same(batch, episodes=2)
    assert [entry["file"] for entry in batch.metadata["episodes"]] == ["logs/ep1", "logs/ep2"]
    (tmp_path / "logs/ep2_state.csv").unlink()
    line = refused("import", "source=logs", chosen, folder=tmp_path)
    assert line == "logs: there is no ep2_state.csv, which the mapping wants as the state of ep2"


def test_folders_below_are_read_when_the_pattern_says_so(tmp_path: Path) -> None:
    (tmp_path / "logs/old").mkdir(parents=True)
    head = "time,action.shoulder,action.elbow,position.shoulder,position.elbow\n"
    rows = (",".join(map(str, row)) for row in np.column_stack([TIME, ACTION, POSITION]))
    (tmp_path / "logs/old/a.csv").write_text(head + "\n".join(rows))
    line = refused("import", "source=logs", folder=tmp_path)
    assert line.endswith("there are 1 in folders below, such as logs/old/a.csv: mapping.files='**/*' takes them")
    check_same(imported(tmp_path, "logs", "mapping.files='**/*'"))
    (tmp_path / "logs/b.csv").write_bytes((tmp_path / "logs/old/a.csv").read_bytes().replace(b"\n", b"\r"))
    check_same(imported(tmp_path, "logs"))  # that above alone, whose lines end with CR as on old Macintoshes


def test_joints_may_be_numbers_and_a_wide_list_says_how_to_name_one(tmp_path: Path) -> None:
    lists = [{"t": t, "a": [9.0, *a, *[0.0] * 23], "q": [*q]} for t, a, q in zip(TIME, ACTION, POSITION, strict=True)]
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, lists)))
    chosen = mapping(tmp_path, "a[{joint}]", ["q[0]", "q[1]"], time="t", joints={"shoulder": 1, "elbow": 2})
    check_same(imported(tmp_path, "log.jsonl", chosen))
    line = refused("import", "source=log.jsonl", mapping(tmp_path, "a", "q", time="t"), folder=tmp_path)
    assert line.endswith("26 values a row for action, but 2 joints; name each by its number from 0, such as a[3]")


def plain_csv(folder: Path, time: np.ndarray, **more: np.ndarray) -> None:
    columns = {"time": time, **{f"action.{joint}": a for joint, a in zip(JOINTS, ACTION.T, strict=True)}}
    columns |= {f"position.{joint}": q for joint, q in zip(JOINTS, POSITION.T, strict=True)} | more
    rows = (",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True))
    (folder / "log.csv").write_text("\n".join([",".join(columns), *rows]))


def test_a_velocity_without_a_value_is_no_velocity(tmp_path: Path) -> None:
    nothing = {f"velocity.{joint}": np.full(len(TIME), np.nan) for joint in JOINTS}
    plain_csv(tmp_path, TIME, **nothing)
    done("import", "source=log.csv", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    check_same(batch)
    assert batch.metadata["velocity"] == "derived from positions"
    np.testing.assert_allclose(batch.episodes[0].velocity, np.gradient(POSITION, TIME, axis=0), atol=1e-9)
    line = refused("import", "source=log.csv", "mapping.signals.velocity.optional=false", folder=tmp_path)
    assert line.endswith("no row has one; leave velocity out of the mapping, or say optional: true")
    plain_csv(tmp_path, TIME, **nothing | {"velocity.shoulder": TIME})  # what is optional is of all joints or of none
    line = refused("import", "source=log.csv", folder=tmp_path)
    assert line.endswith("no row has one of every joint; leave it out with '~mapping.signals.velocity'")
    done("import", "source=log.csv", "~mapping.signals.velocity", "name=other", folder=tmp_path)
    plain_csv(tmp_path, TIME, **{"position.elbow": np.full(len(TIME), np.nan)})
    line = refused("import", "source=log.csv", folder=tmp_path)
    assert line.endswith("leave it out with mapping.joints=[shoulder]")


def test_a_clock_too_coarse_is_not_mended_by_dropping_most_rows(tmp_path: Path) -> None:
    plain_csv(tmp_path, np.floor(TIME / 0.1) * 0.1)
    line = refused("import", "source=log.csv", folder=tmp_path)
    assert "the clock is too coarse for so many rows" in line and "mapping.time.period=0.01" in line
    assert "drop" not in line
    plain_csv(tmp_path, np.floor(TIME / 0.16 + 0.4))  # ticks that the log's ends cut off do not count
    assert "mapping.time.period=0.0625 if" in refused("import", "source=log.csv", folder=tmp_path)
    plain_csv(tmp_path, np.floor(TIME / 0.1) * 0.1)
    done("import", "source=log.csv", "mapping.time.period=0.01", "name=log", folder=tmp_path)
    check_same(read(tmp_path / "runs/log/import/trajectories.parquet"))


@pytest.mark.parametrize(("unit", "top"), [("us", 2.0**32), ("ms", 2.0**16), ("s", 4294.967296)])
def test_a_counter_that_begins_again_goes_on(tmp_path: Path, unit: str, top: float) -> None:
    tick = {"us": 1e-6, "ms": 1e-3, "s": 1.0}[unit]
    plain_csv(tmp_path, (top - 1.0 / tick + TIME / tick) % top)
    line = refused("import", "source=log.csv", f"mapping.time.unit={unit}", folder=tmp_path)
    assert f"a counter that begins again? mapping.time.wrap={top:.12g} says so" in line
    settings = ("mapping.time.unit=" + unit, f"mapping.time.wrap={top:.12g}")
    check_same(imported(tmp_path, "log.csv", *settings), tolerance=1e-6)


def test_rows_in_disorder_are_no_counter(tmp_path: Path) -> None:
    """The clock of one of them jumps back by a full counter, that of others by less."""
    top = 2.0**16
    stamps = np.concatenate([TIME[:20] * 1e3, [top, 300.0, top - 500.0, 0.0], top + TIME[24:] * 1e3])
    plain_csv(tmp_path, stamps)
    line = refused("import", "source=log.csv", "mapping.time.unit=ms", folder=tmp_path)
    assert "the clock jumps back" in line and "wrap" not in line and "sort its rows" in line


def test_names_that_the_command_line_cannot_read_come_with_their_quotes(tmp_path: Path) -> None:
    plain_csv(tmp_path, TIME)
    for name in ("log(1).csv", "epoch=3-v1.csv"):
        (tmp_path / "log.csv").rename(tmp_path / name)
        line = refused("import", f"source={name}", folder=tmp_path)
        assert line.endswith(f"such characters take quotes inside those of the shell: 'source=\"{name}\"'")
        done("import", f'source="{name}"', "--check", folder=tmp_path)
        (tmp_path / name).rename(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("typed", "quoted"),
    [
        ("mapping.name={take}", 'mapping.name="{take}"'),
        ("mapping.path=a{date}/{motion}", 'mapping.path="a{date}/{motion}"'),
        ("mapping.signals.position={column: [a{joint}, b]}", 'mapping.signals.position={column: ["a{joint}", b]}'),
    ],
)
def test_places_in_a_text_come_with_their_quotes(tmp_path: Path, typed: str, quoted: str) -> None:
    line = refused("import", "source=log.csv", typed, folder=tmp_path)
    assert line.endswith(f"such characters take quotes inside those of the shell: '{quoted}'")
    assert "cannot be read" not in refused("import", "source=log.csv", quoted, folder=tmp_path)
    assert refused("import", "source=log.csv", "mapping.name={take", folder=tmp_path).endswith("cannot be read")


@pytest.mark.parametrize("word", ["voltage={column: time, unit: V}", "own={column: time, unit: s}", "velocity.bits=16"])
def test_signals_that_a_mapping_does_not_name_can_be_typed(tmp_path: Path, word: str) -> None:
    plain_csv(tmp_path, TIME)
    done("import", "source=log.csv", f"mapping.signals.{word}", "--check", folder=tmp_path)
    line = refused("import", "source=log.csv", "mapping.signals.velocity.bit=16", folder=tmp_path)
    assert line == "mapping.signals.velocity.bit: no such setting; did you mean bits?"
    line = refused("import", "source=log.csv", "mapping.signals.position.unit=deg", folder=tmp_path)
    assert line.endswith("""with a unit it is 'mapping.signals.position={column: "position.{joint}", unit: ...}'""")


def test_a_mapping_that_is_named_without_its_ending_is_offered(tmp_path: Path) -> None:
    mapping(tmp_path)
    assert refused("import", "source=log.csv", "mapping=m", folder=tmp_path).endswith("; yours is mapping=m.yaml")


def test_folders_and_runs_may_be_called_by_numbers(tmp_path: Path) -> None:
    for name in ("20", "2024_01", "1e3", "true"):
        line = refused("import", f"source={name}", mapping(tmp_path), folder=tmp_path)
        assert line == f"source = {name}: there is no such file, folder or pattern"
        (tmp_path / name).mkdir()
        plain_csv(tmp_path / name, TIME)
        done("import", f"source={name}", f"name={name}", folder=tmp_path)
        assert (tmp_path / f"runs/{name}/import/trajectories.parquet").is_file()
        line = refused("audit", f"real={name}", f"sim={name}", folder=tmp_path)
        assert line.startswith(f"no world called {name}")
    line = refused("import", "source=20", mapping(tmp_path), "mapping.files={a: 20}", folder=tmp_path)
    assert """a text: "20" in a file, '"20"' in a shell""" in line


def test_a_lag_is_the_same_whenever_the_clock_began(tmp_path: Path) -> None:
    lags = []
    for origin in (0.0, 1234.567, 1.7e9 + 0.123):
        plain_csv(tmp_path, TIME + origin)
        document = json.loads(gsl("import", "source=log.csv", "--check", "--json", folder=tmp_path).out)
        lags.append(document["episodes"][0]["lag"])
    assert lags == pytest.approx([lags[0]] * 3, abs=1e-4)


def test_a_joint_that_turns_on_and_on_is_taken_when_its_unit_is_said(tmp_path: Path) -> None:
    rolled = {
        "t": TIME,
        "q": np.column_stack([30.0 * TIME, POSITION[:, 1]]),
        "g": np.column_stack([30.0 * TIME, ACTION[:, 1]]),
    }
    np.savez(tmp_path / "log.npz", **rolled)
    line = refused("import", "source=log.npz", mapping(tmp_path, "g", "q", time="t"), folder=tmp_path)
    assert "One that turns so far: unit: {shoulder: rad}" in line
    position = {"column": "q", "unit": {"shoulder": "rad"}}
    batch = imported(tmp_path, "log.npz", mapping(tmp_path, "g", position, time="t"))
    assert batch.episodes[0].position[-1, 0] == pytest.approx(90.0)


@pytest.mark.parametrize(("unit", "kind"), [("rad/s", "speed"), ("rpm", "speed"), ("Nm", "torque")])
def test_commands_of_other_kinds_are_refused_as_what_they_are(tmp_path: Path, unit: str, kind: str) -> None:
    np.savez(tmp_path / "log.npz", **ARRAYS)
    chosen = mapping(tmp_path, {"column": "des_dof_pos", "unit": unit})
    line = refused("import", "source=log.npz", chosen, folder=tmp_path)
    name = {"speed": "velocity_command", "torque": "torque_command"}[kind]
    assert f"is a command of {kind}; it is signals: {{{name}: ...}}, beside an action or without any" in line
