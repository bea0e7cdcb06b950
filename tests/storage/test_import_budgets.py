"""Logs of strangers that are small and would be large, or of sizes that no file has: one line, before they are read."""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from commands import refused
from test_import import mapping

pytestmark = pytest.mark.slow

SMALL = "memory=0.01"
SIGNALS = {"action": "goal", "position": "q"}
LOG = "t,goal_a,q_a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k},{0.1 * k}\n" for k in range(50))


def told(source: Path, *more: str, **settings: object) -> str:
    folder = source.parent
    settings = {"signals": SIGNALS, "joints": ["a"], **settings}
    return refused("import", f"source={source}", mapping(folder / "m.yaml", **settings), *more, folder=folder)


def test_tensors_that_unpack_to_more_than_the_memory(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    with zipfile.ZipFile(tmp_path / "log.pt", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("log/data/0", bytes(30_000_000))
    assert (tmp_path / "log.pt").stat().st_size < 100_000
    assert "would need about 0.06 GB" in told(tmp_path / "log.pt", SMALL)


def test_tensors_without_numbers_are_one_line(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    torch.save({name: torch.empty(40, device="meta") for name in ("t", "goal", "q")}, tmp_path / "log.pt")
    assert "internal error" not in told(tmp_path / "log.pt")


def test_matrices_that_unpack_to_more_than_the_memory(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", {"q": np.zeros(3_000_000)}, do_compression=True)
    assert (tmp_path / "log.mat").stat().st_size < 100_000
    assert "would need about 0.072 GB" in told(tmp_path / "log.mat", SMALL)


def test_lists_of_a_parquet_file_take_more_memory_than_numbers(tmp_path: Path) -> None:
    rows = pa.array([[0.0, 0.0]] * 60_000)
    pq.write_table(
        pa.table({"t": pa.array(0.01 * np.arange(60_000)), "goal": rows, "q": rows}), tmp_path / "log.parquet"
    )
    assert "would need about" in told(tmp_path / "log.parquet", "memory=0.02")


def test_a_chunk_of_an_hdf5_file_has_a_budget(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name in ("t", "goal", "q"):
            file.create_dataset(name, (40,), "f8", maxshape=(None,), chunks=(100_000_000,), compression="gzip")
    assert "is stored in chunks of more than 256 MB" in told(tmp_path / "log.h5")


def test_groups_of_an_hdf5_file_that_lie_in_each_other_twice_have_a_budget(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        groups = [file.create_group(f"group_{number}") for number in range(40)]
        for outer, inner in pairwise(groups):
            outer["a"] = outer["b"] = inner
        groups[-1]["t"] = [0.0]
    assert "listing its groups takes more than" in told(tmp_path / "log.h5")


@pytest.mark.parametrize("shape", ["(" * 900, "(" + "9" * 400 + ",)", "(1000000000000000, 1000000000000000)"])
def test_a_shape_that_no_array_has(shape: str, tmp_path: Path) -> None:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(1021) + "\n"
    packed = io.BytesIO(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode())
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        for name in ("t", "goal", "q"):
            archive.writestr(f"{name}.npy", packed.getvalue())
    line = told(tmp_path / "log.npz")
    assert "would need about" in line or "is no numpy array" in line


@pytest.mark.parametrize(
    "settings",
    [
        {"period": 1e-9}, {"period": 1e-300}, {"period": int("9" * 400)}, {"longest_gap": 1e300, "period": 1e-9},
        {"time": {1: 2}}, {"time": {"__dataclass_self__": 1}}, {1: 2},
        {"about": {"x": {"2026": float("nan")}}, "period": 9e99},
        {"signals": {"action": {"column": "goal_{joint}", "unit": "ticks/" + "9" * 400}, "position": "q_{joint}"}},
    ],
)  # fmt: skip
def test_a_mapping_asks_for_no_gigabytes(settings: dict[Any, Any], tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(LOG)
    signals = {"action": "goal_{joint}", "position": "q_{joint}"}
    whole = {"joints": ["a"], "time": {"column": "t"}, "signals": signals, **settings}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(whole))
    line = refused("import", "source=log.csv", "mapping=m.yaml", folder=tmp_path)
    assert "internal error" not in line and len(line) < 1000


def test_a_column_that_tells_no_episodes_apart(tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * k:.2f},{k // 2},0.1,0.1\n" for k in range(40_000))
    (tmp_path / "log.csv").write_text(f"t,who,goal_a,q_a\n{rows}")
    signals = {"action": "goal_{joint}", "position": "q_{joint}"}
    line = told(tmp_path / "log.csv", signals=signals, episode="who")
    assert "tells 20,000 episodes apart" in line


def test_lines_without_end_in_a_packed_log(tmp_path: Path) -> None:
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(LOG.encode() + b"\n" * 210_000_000, 1))
    assert "unpacks to more than 0.2 GB" in told(
        tmp_path / "log.csv.gz", signals={"action": "goal_a", "position": "q_a"}
    )


@pytest.mark.parametrize(
    "files", ["/etc/*", "../*.csv", "a/../../*", "**x", {"": ""}, {}, {"": "../log.csv"}, "[", "\0"]
)
def test_patterns_of_files_stay_below_the_source(files: object, tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "log.csv").write_text(LOG)
    settings = {"signals": {"action": "goal_{joint}", "position": "q_{joint}"}, "joints": ["a"], "files": files}
    line = refused("import", "source=logs", mapping(tmp_path / "m.yaml", **settings), folder=tmp_path)
    assert "internal error" not in line


def test_numbers_that_no_data_set_has(tmp_path: Path) -> None:
    (tmp_path / "set/meta").mkdir(parents=True)
    features = {name: {"dtype": "float32", "shape": [1], "names": ["a"]} for name in ("observation.state", "action")}
    info = {"codebase_version": "v2.1", "fps": 50, "features": features}
    for chunk, episode in (([], 0), (float("inf"), 0), (1000, int("9" * 250))):
        (tmp_path / "set/meta/info.json").write_text(json.dumps({**info, "chunks_size": chunk}))
        (tmp_path / "set/meta/episodes.jsonl").write_text(json.dumps({"episode_index": episode, "length": 5}))
        line = refused("import", "source=set", "mapping=plain", folder=tmp_path)
        assert "chunks_size is" in line or "has no whole number" in line


def test_a_name_of_a_robot_makes_no_second_line(tmp_path: Path) -> None:
    joint = '<joint name="{}" type="revolute"><parent link="a"/><child link="b"/>'
    joint += '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    links = '<link name="a"/><link name="b"/>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="r">{links}{joint.format("x&#10;urdf: y")}</robot>')
    line = refused("init", "urdf=arm.urdf", "name=mine", folder=tmp_path)
    assert "has marks that cannot be printed" in line
