"""Logs that cannot be taken as they are: one line that says what, where and what to do, and nothing is written."""

from __future__ import annotations

import gzip
import json
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import gsl, refused
from test_import import ACTION, JOINTS, LAG, POSITION, TIME, csv, mapping, plain, waves

from gsl.errors import TrajectoryError
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

Columns = dict[str, Any]


def told(folder: Path, source: Path | str, *more: str, **settings: Any) -> str:
    return refused("import", f"source={source}", mapping(folder / "m.yaml", **settings), *more, folder=folder)


def changed(name: str, change: Callable[[Any], Any]) -> Callable[[Columns], Columns]:
    return lambda columns: {**columns, name: change(columns[name].astype(object))}


def at(row: int, value: object) -> Callable[[Any], Any]:
    def change(values: Any) -> Any:
        values[row] = value
        return values

    return change


def swapped(columns: Columns) -> Columns:
    names = {"goal": "q", "q": "goal"}
    return {"_".join([names.get(n.split("_")[0], n.split("_")[0]), *n.split("_")[1:]]): v for n, v in columns.items()}


def exchanged(columns: Columns) -> Columns:
    """Swap what two joints measured; the commands are right."""
    return {**columns, "q_shoulder": columns["q_elbow"], "q_elbow": columns["q_shoulder"]}


def scaled(factor: float, *prefixes: str) -> Callable[[Columns], Columns]:
    return lambda columns: {name: factor * v if name.startswith(prefixes) else v for name, v in columns.items()}


def without(name: str) -> Callable[[Columns], Columns]:
    return lambda columns: {key: values for key, values in columns.items() if key != name}


def from_row(row: int, jump: float) -> Callable[[Columns], Columns]:
    return lambda columns: {**columns, "t": columns["t"] + jump * (np.arange(len(TIME)) >= row)}


def stuck(columns: Columns) -> Columns:
    return {**columns, "t": np.where(np.arange(len(TIME)) == 40, columns["t"][39], columns["t"])}


WRONG = {
    "command and state swapped": (swapped, f"comes {1e3 * LAG:.0f} ms before action: are the columns of commands"),
    "joints swapped": (
        exchanged,
        "position.shoulder: follows action.elbow and not action.shoulder: are the columns of joints swapped",
    ),
    "joints swapped, one the other way round": (
        lambda c: exchanged(scaled(-1.0, "q_shoulder")(c)),
        "position.shoulder: follows action.elbow",
    ),
    "degrees": (scaled(180.0 / np.pi, "q", "goal"), "position.shoulder|action.shoulder: reaches 28.6"),
    "degrees of positions only": (scaled(57.3, "q"), "are these degrees"),
    "small degrees of commands": (
        lambda c: scaled(57.3, "goal")(scaled(0.2, "q", "goal")(c)),
        "moves 57.\\d times as far",
    ),
    "ticks": (lambda c: {n: np.round(2048 + 652 * v) if n != "t" else v for n, v in c.items()}, "are these ticks"),
    "milliseconds for seconds": (scaled(1e6, "t"), "rows are 1e\\+04 s apart; is time"),
    "microseconds in a mapping of seconds": (scaled(1e-6, "t"), "rows are 1e-08 s apart"),
    "microseconds for milliseconds": (scaled(1e-3, "t"), "rows are 1e-05 s apart"),
    "a clock that starts again": (
        lambda c: {name: np.concatenate([values, values]) for name, values in c.items()},
        "column t, line 303: the clock jumps back by 3 s; cut the file there, or sort its rows",
    ),
    "a clock that jumps back": (
        from_row(100, -0.5),
        "column t, line 102: the clock jumps back by 0.49 s; .* cut the file",
    ),
    "a stamp twice": (stuck, "column t, line 42: the stamp of the row before again .* mapping.duplicates=drop"),
    "a block that was logged twice": (
        lambda c: {name: np.concatenate([values[:90], values[50:]]) for name, values in c.items()},
        "column t, line 92: the clock jumps back by 0.39 s; these stamps were there before: drop the rows that repe",
    ),
    "a missing joint": (without("q_elbow"), "column q_elbow: is missing; the file has t, goal_shoulder"),
    "a column misspelt": (lambda c: {n.replace("q_e", "qe"): v for n, v in c.items()}, "did you mean qelbow"),
    "no stamps": (without("t"), "column t: is missing"),
    "NaN": (changed("q_elbow", at(7, "nan")), "column q_elbow, line 9: is not a finite number; .* mapping.blanks=skip"),
    "infinity": (changed("q_elbow", at(7, "inf")), "column q_elbow, line 9: is not a finite number"),
    "an empty cell": (changed("goal_elbow", at(9, "")), "column goal_elbow, line 11: is not a finite number"),
    "a word": (changed("q_elbow", at(7, "stall")), "column q_elbow, line 9: 'stall' is not a number"),
    "texts": (lambda c: {**c, "q_elbow": np.full(len(TIME), "up")}, "column q_elbow: holds texts"),
    "an empty stamp": (changed("t", at(5, "")), "column t, line 7: is not a finite number"),
    "an angle that wraps": (
        lambda c: {**c, "goal_shoulder": 8.0 * c["goal_shoulder"], "q_shoulder": np.mod(8.0 * c["q_shoulder"], 6.2832)},
        "log.csv: position.shoulder, episode 0, row .* jumps by a turn, .* mapping.unwrap=true joins the turns",
    ),
    "one row": (lambda c: {name: values[:1] for name, values in c.items()}, "has 1 row of positions"),
    "no rows": (lambda c: {name: values[:0] for name, values in c.items()}, "has no rows; log it again"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_log_is_one_clear_line(tmp_path: Path, name: str) -> None:
    change, words = WRONG[name]
    line = told(tmp_path, csv(tmp_path / "log.csv", change(plain())))
    assert re.search(words, line), line
    assert "log.csv" in line or line.startswith("log: ")


def test_joints_that_are_commanded_alike_or_dragged_along_are_not_swapped(tmp_path: Path) -> None:
    both = {name: plain()[name.replace("elbow", "shoulder")] for name in plain()}
    still = {**plain(), "goal_elbow": 0.0 * TIME, "q_elbow": 0.03 * plain()["q_shoulder"]}
    for name, columns in (("both", both), ("still", still)):
        said = gsl(
            *("import", f"source={csv(tmp_path / f'{name}.csv', columns)}", mapping(tmp_path / "m.yaml")),
            "--check",
            folder=tmp_path,
        )
        assert said.code == 0 and "follows" not in said.out, said


def test_swapped_joints_are_seen_where_another_episode_commands_them_alike(tmp_path: Path) -> None:
    alike = {name: plain()[name.replace("elbow", "shoulder")] for name in plain()}
    csv(tmp_path / "a.csv", alike)
    csv(tmp_path / "b.csv", exchanged(plain()))
    assert "follows action.elbow and not action.shoulder" in told(tmp_path, tmp_path)


def test_what_looks_wrong_can_be_accepted(tmp_path: Path) -> None:
    source = csv(tmp_path / "log.csv", swapped(plain()))
    said = gsl("import", f"source={source}", mapping(tmp_path / "m.yaml"), "accept=true", folder=tmp_path)
    assert said.code == 0 and "warning: position: comes 50 ms before action" in said.err


@pytest.mark.parametrize(("rows", "words"), [(0, "of this row"), (1, "of the next row")])
def test_commands_that_are_copies_of_positions_are_told(tmp_path: Path, rows: int, words: str) -> None:
    columns = {name: np.roll(plain()[name.replace("goal", "q")], -rows) for name in plain() if name != "t"}
    columns = {name: values if name.startswith("goal") else plain()[name] for name, values in columns.items()}
    source = csv(tmp_path / "log.csv", {"t": TIME[:-1], **{name: values[:-1] for name, values in columns.items()}})
    said = gsl("import", f"source={source}", mapping(tmp_path / "m.yaml"), "--check", folder=tmp_path)
    assert said.code == 0
    assert f"action.shoulder, action.elbow: is a copy of the measured position {words}" in said.out


def test_what_no_file_of_trajectories_holds_is_named_in_the_log_itself(tmp_path: Path) -> None:
    jump = {name: values * (1.0 if name == "t" else 1.4e12) for name, values in plain().items()}
    for columns, words in (
        (changed("goal_elbow", at(20, 1e30))(plain()), "column action.elbow: is 1e+30 0.2 s after the start of log,"),
        (jump, "column velocity.shoulder: is "),
    ):
        source, settings = csv(tmp_path / "log.csv", columns), mapping(tmp_path / "m.yaml")
        line = refused("import", f"source={source}", settings, "accept=true", folder=tmp_path)
        assert f"log.csv, {words}" in line
        said = gsl("import", f"source={source}", settings, "accept=true", "--check", folder=tmp_path)
        assert (said.code, words in said.out) == (2, True)


def test_a_stamp_that_comes_twice_can_be_dropped(tmp_path: Path) -> None:
    source = csv(tmp_path / "log.csv", stuck(plain()))
    said = gsl("import", f"source={source}", mapping(tmp_path / "m.yaml", duplicates="drop"), folder=tmp_path)
    assert said.code == 0, said.err


def test_a_check_tells_every_problem_and_ends_with_the_code_of_a_refusal(tmp_path: Path) -> None:
    csv(tmp_path / "a.csv", plain())
    csv(tmp_path / "b.csv", from_row(100, -0.5)(plain()))
    (tmp_path / "c.csv").write_text("")
    arguments = ("import", f"source={tmp_path}/*.csv", mapping(tmp_path / "m.yaml"), "--check", "--json")
    said = gsl(*arguments, folder=tmp_path)
    document = json.loads(said.out)
    assert said.code == 2 == document["exit_code"] and len(document["episodes"]) == 1
    assert [line.partition(":")[0].rpartition("/")[2] for line in document["refused"]] == [
        "b.csv, column t, line 102",
        "c.csv",
    ]
    assert not (tmp_path / "runs").exists()


TEXT = b"t,goal_shoulder\n" + b"0.01,0.5\n" * 500
FILES = {
    "empty.csv": (b"", "is empty"),
    "empty.csv.gz": (gzip.compress(b""), "is empty"),
    "cut.csv.gz": (gzip.compress(TEXT)[:-20], "is cut off, as that of a killed logger is"),
    "plain.csv.gz": (TEXT, "is no gzip file"),
    "binary.csv": (bytes(range(1, 256)), "is no text"),
    "pickle.csv": (pickle.dumps(TIME), "is a Python pickle"),
    "pickle.json": (pickle.dumps(TIME), "is a Python pickle"),
    "pickle.json.gz": (gzip.compress(pickle.dumps(TIME)), "is a Python pickle"),
    "pickle.npz": (pickle.dumps(TIME), "is no npz archive"),
    "cut.json": (b'{"t": [0.0, 0.1', r"is not JSON \(line 1"),
    "deep.json": (b"[" * 100_000, "is not JSON"),
    "number.json": (b"3", "has no rows of named values"),
    "ragged.json": (
        b'[{"t": 0, "goal_shoulder": [1, [2, 3]], "goal_elbow": 0, "q_shoulder": 0, "q_elbow": 0}]',
        "is not a number, or not as long as the first",
    ),
    "empty.npz": (b"", "is empty"),
    "no.parquet": (b"PAR1 or not", "is not a parquet file"),
    "ragged.csv": (
        b"t,goal_shoulder,goal_elbow,q_shoulder,q_elbow\n0,0,0,0,0\n1,2,3,4,5,6,7\n",
        "rows of another length",
    ),
    "name.csv": (b"t," + b"q" * 140_000 + b"\n0,0\n", "cannot be taken apart: field larger than field limit"),
    "twice.csv": (b"t,t,q_shoulder\n0,0,0\n1,1,1\n", "several columns of this name"),
    "endless.csv": (b"t,q\n" + b"1" * 5_000_000, "has a line of more than"),
    "what.xlsx": (b"PK", r"\.xlsx is no format that is read; there is \.csv"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_not_what_it_seems_is_one_clear_line(tmp_path: Path, name: str) -> None:
    content, words = FILES[name]
    (tmp_path / name).write_bytes(content)
    line = told(tmp_path, tmp_path / name)
    assert name in line and re.search(words, line), line


def test_a_wrong_cell_far_down_is_one_line(tmp_path: Path) -> None:
    rows = [f"{0.01 * k:.2f},0.1,0.1,0.1,0.1" for k in range(300_000)]
    rows[290_000] = "2900.00,0.1,0.1,x,0.1"
    (tmp_path / "log.csv").write_text("\n".join([",".join(plain()), *rows]) + "\n")
    assert "line 290002: 'x' is not a number" in told(tmp_path, tmp_path / "log.csv")


def test_objects_in_an_npz_are_not_unpickled(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", t=TIME, goal=ACTION, q=np.array([{"a": 1}] * len(TIME), dtype=object))
    line = told(tmp_path, tmp_path / "log.npz", signals={"action": "goal", "position": "q"})
    assert "column q: holds Python objects" in line


def test_a_large_file_says_what_it_needs_before_it_is_read(tmp_path: Path) -> None:
    signals = {"action": "goal", "position": "q"}
    np.savez_compressed(tmp_path / "log.npz", t=np.arange(2e5), goal=np.zeros((200_000, 2)), q=np.zeros((200_000, 2)))
    assert "would need about" in told(tmp_path, tmp_path / "log.npz", "memory=0.01", signals=signals)
    rows = [{"t": t, "goal": [0, 0], "q": [0, 0]} for t in range(30_000)]
    (tmp_path / "log.json").write_text(json.dumps(rows))
    assert "would need about" in told(tmp_path, tmp_path / "log.json", "memory=0.01", signals=signals)
    (tmp_path / "bomb.json.gz").write_bytes(gzip.compress(b"[" + b" " * 30_000_000))
    assert "unpacks to more than" in told(tmp_path, tmp_path / "bomb.json.gz", "memory=0.1", signals=signals)


def test_a_text_table_is_read_in_pieces_of_which_only_the_named_columns_stay(tmp_path: Path) -> None:
    ballast = {f"other_{k}": np.full(len(TIME), "1" * 2000) for k in range(8)}
    source = csv(tmp_path / "log.csv", {**plain(), **ballast})
    assert source.stat().st_size > 4e6
    said = gsl("import", f"source={source}", mapping(tmp_path / "m.yaml"), "memory=0.0001", folder=tmp_path)
    assert said.code == 0, said.err
    long = {name: np.tile(values, 20) for name, values in {**plain(), "t": TIME}.items()}
    long["t"] = 0.01 * np.arange(len(long["t"]))
    assert "would need about" in told(tmp_path, csv(tmp_path / "log.csv", long), "memory=0.0001", "force=true")


def bomb(path: Path, names: list[str], rows: int) -> Path:
    """Write a small parquet file whose columns are one value, again and again."""
    column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int8)), pa.array([0.0]))
    pq.write_table(pa.table(dict.fromkeys(names, column)), path, compression="zstd")
    return path


def test_a_parquet_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = bomb(tmp_path / "bomb.parquet", ["t", "goal_shoulder", "goal_elbow", "q_shoulder", "q_elbow"], 3_000_000)
    assert path.stat().st_size < 100_000
    assert "bomb.parquet: would need about 0.24 GB of memory" in told(tmp_path, path, "memory=0.2")


def test_a_trajectory_file_that_declares_too_much_is_refused_unread(tmp_path: Path) -> None:
    path, blanks = tmp_path / "bomb.parquet", pa.nulls(41_000_000)
    names = ("time", "position.a", "velocity.a", "action.a", *(f"more.{k}" for k in range(46)))
    pq.write_table(pa.table(dict.fromkeys(names, blanks)), path, compression="zstd")
    with pytest.raises(TrajectoryError, match="declares 41,000,000 rows, 16.4 GB of memory"):
        read(path)


SETTINGS = {
    "a key of the mapping": ({"jionts": ["a"]}, "mapping.jionts: no such setting; did you mean joints"),
    "a key of a signal": (
        {"signals": {"action": {"colum": "a"}, "position": "q"}},
        "mapping.signals.action.colum: no such setting; did you mean column",
    ),
    "a unit": (
        {"signals": {"action": "a", "position": {"column": "q", "unit": "degs"}}},
        "mapping.signals.position.unit = degs: is no unit for what is in rad; did you mean deg",
    ),
    "a unit of time": (
        {"time": {"column": "t", "unit": "min"}},
        "mapping.time.unit = min: is no unit for what is in s",
    ),
    "a signal": (
        {"signals": {"action": "a", "position": "q", "velocty": "v"}},
        "mapping.signals.velocty: no such signal, did you mean velocity?",
    ),
    "a name that is taken": (
        {"signals": {"action": "goal_{joint}", "position": "q_{joint}", "reward": {"column": "t", "unit": "1"}}},
        "mapping.signals.reward: is a name of the contract that no log fills; call it otherwise",
    ),
    "a list of no columns": (
        {"signals": {"action": {"column": []}, "position": "q"}},
        "mapping.signals.action.column: names no column",
    ),
    "no positions": ({"signals": {"action": "a"}}, "mapping.signals.position: has no value; say in which column"),
    "positions misspelt": (
        {"signals": {"action": "a", "postion": "p"}},
        "mapping.signals.position: has no value; is it postion?",
    ),
    "a sign": (
        {"signals": {"action": "goal_{joint}", "position": {"column": "q_{joint}", "sign": 2}}},
        "mapping.signals.position.sign = 2.0: must be 1 or -1",
    ),
    "a joint's name": (
        {"signals": {"action": "goal_{joint}", "position": {"column": "q_{joint}", "sign": {"elbo": -1}}}},
        "mapping.signals.position.sign.elbo: is no joint; did you mean elbow",
    ),
    "a joint's name, where joints are found": (
        {
            "joints": None,
            "signals": {"action": "goal_{joint}", "position": {"column": "q_{joint}", "zero": {"elbo": 1}}},
        },
        "mapping.signals.position.zero.elbo: is no joint; did you mean elbow",
    ),
    "an axis": (
        {"signals": {"action": "goal_{joint}", "position": "q_{joint}", "gyro": {"column": "g", "sign": {"X": -1}}}},
        "mapping.signals.gyro.sign.X: is no axis; did you mean x?",
    ),
    "one value by joint": (
        {
            "signals": {
                "action": "goal_{joint}",
                "position": "q_{joint}",
                "voltage": {"column": "t", "zero": {"elbow": 1}},
            }
        },
        "mapping.signals.voltage.zero: differs by joint, but the signal is one for all of them; give one value",
    ),
    "a role": (
        {"signals": {"action": {"file": "cmd", "column": "a"}, "position": "q"}},
        "mapping.signals.action.file = cmd: goes with no file: say files={cmd: its name}",
    ),
    "joints twice": ({"joints": ["a", "a"]}, "mapping.joints = a, a: must be different names"),
    "a negative period": ({"period": -1}, "mapping.period = -1: must be at least 1e-06 (s)"),
    "a field": (
        {"about": {"kp": "{gain}"}},
        "mapping.about.kp = {gain}: there is no field or column gain; there is file",
    ),
    "a label that changes": (
        {"about": {"at": "{q_elbow}"}},
        "column q_elbow, line 3: changes from 0.1",
    ),
    "a path": ({"path": "{day}/{motion}"}, "mapping.path = {day}/{motion}: does not fit the episode log"),
    "too few columns": (
        {"signals": {"action": "goal_elbow", "position": "q_{joint}"}},
        "column goal_elbow: 1 values a row for action, but 2 joints",
    ),
    "one column for two joints": (
        {"signals": {"action": "goal_{joint}", "position": ["q_elbow", "q_elbow"]}},
        "mapping.signals.position.column = q_elbow: is that of several joints for position; every joint has",
    ),
    "an entry too far": (
        {"signals": {"action": "goal_{joint}", "position": ["q_elbow[0]", "q_elbow[3]"]}},
        "column q_elbow: has 1 values a row; [3] counts from 0",
    ),
    "a word for signals": ({"signals": "all"}, "mapping.signals = all: must be settings"),
    "two clocks": ({"command_offset": 99.0}, "two clocks? Say what the commands' is ahead"),
}


def test_a_column_that_is_used_already_is_not_what_was_meant(tmp_path: Path) -> None:
    columns = {"t": TIME, "goal_j1": ACTION[:, 0], "goal_j2": ACTION[:, 1], "q_j1": POSITION[:, 0]}
    line = told(tmp_path, csv(tmp_path / "log.csv", columns), joints=["j1", "j2"])
    assert "column q_j2: is missing; the file has t, goal_j1" in line


@pytest.mark.parametrize("name", SETTINGS)
def test_a_wrong_mapping_is_one_clear_line(tmp_path: Path, name: str) -> None:
    settings, words = SETTINGS[name]
    line = told(tmp_path, csv(tmp_path / "log.csv", plain()), **settings)
    assert words in line, line


def test_a_log_that_was_not_imported_says_what_to_do_first(tmp_path: Path) -> None:
    for place in ("log.csv", "logs/log.csv"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        csv(tmp_path / place, plain())
    for source in ("log.csv", "logs"):
        line = refused("diagnose", f"real={source}", "sim=so101", "out=runs/refused", folder=tmp_path)
        assert f"gsl import source={source} " in line


def test_sources_and_mappings_that_are_not_there_are_one_clear_line(tmp_path: Path) -> None:
    chosen = mapping(tmp_path / "m.yaml")
    assert "source: has no value yet" in refused("import", chosen, folder=tmp_path)
    assert "there is no such file, folder or pattern" in refused("import", chosen, "source=no.csv", folder=tmp_path)
    (tmp_path / "empty").mkdir()
    assert "empty: holds no file that ends with" in refused("import", chosen, "source=empty", folder=tmp_path)
    line = refused("import", "mapping=so101", "source=empty", folder=tmp_path)
    assert "no mapping called so101; did you mean so101_arm" in line
    (tmp_path / "arm.urdf").write_text("<robot/>")
    line = refused("import", "mapping=arm.urdf", "source=empty", folder=tmp_path)
    assert "mapping = arm.urdf: is no mapping, whose file's name must end with .yaml" in line
    assert "no.yaml: there is no such file" in refused("import", "mapping=no.yaml", folder=tmp_path)
    csv(tmp_path / "log.csv", plain())
    line = refused("import", "source=log.csv", folder=tmp_path)
    assert "column position.{joint}: is in no column; there is t, goal_shoulder" in line
    folders = mapping(
        tmp_path / "m.yaml",
        files={"a": "a.csv", "b": "b.csv"},
        signals={"action": {"file": "a", "column": "x"}, "position": {"file": "b", "column": "x"}},
    )
    assert "there is none with a.csv" in refused("import", folders, "source=.", folder=tmp_path)
    csv(tmp_path / "a.csv", plain())
    assert "there is no b.csv, which the mapping wants as its b" in refused(
        "import", folders, "source=.", folder=tmp_path
    )


def test_files_of_other_joints_are_not_one_log(tmp_path: Path) -> None:
    for name, joints in (("a", JOINTS), ("b", ("hip", "knee"))):
        columns = {"time": TIME}
        for group, values in (("action", ACTION), ("position", POSITION)):
            columns |= {f"{group}.{joint}": column for joint, column in zip(joints, values.T, strict=True)}
        csv(tmp_path / f"{name}.csv", columns)
    assert "b: has other joints or signals than a" in refused("import", "source=.", folder=tmp_path)


def test_rates_that_differ_are_told(tmp_path: Path) -> None:
    for name, period in (("a", 0.01), ("b", 0.02)):
        time = period * np.arange(200)
        goal, q = waves(time), waves(time - LAG)
        columns = {"t": time, "goal_shoulder": goal[:, 0], "goal_elbow": goal[:, 1], "q_shoulder": q[:, 0]}
        csv(tmp_path / f"{name}.csv", {**columns, "q_elbow": q[:, 1]})
    said = gsl("import", "source=.", mapping(tmp_path / "m.yaml"), "check=true", folder=tmp_path)
    assert "warning: time: episodes have rates of 50 to 100 Hz" in said.out and "mapping.period" in said.out
