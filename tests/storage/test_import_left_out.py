"""What an import leaves out is told: joints without a pair, holes in time, files that end too early."""

from __future__ import annotations

import gzip
import io
import json
import shlex
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from commands import done, gsl, refused
from test_import import ACTION, JOINTS, POSITION, TIME, csv, imported
from test_lerobot import NAMES, degrees, edit, recorded, write_data_set

from gsl.core.likeness import find_alike
from gsl.core.override import spell, spell_key, spell_list, spell_setting
from gsl.storage.importers.sizes import is_open_line

pytestmark = pytest.mark.slow

Columns = dict[str, np.ndarray]


def plain() -> Columns:
    columns = {"time": TIME}
    for group, values in (("action", ACTION), ("position", POSITION)):
        columns |= {f"{group}.{joint}": column for joint, column in zip(JOINTS, values.T, strict=True)}
    return columns


def renamed(old: str, new: str) -> Columns:
    return {name.replace(old, new): values for name, values in plain().items()}


def save_npz(path: Path, columns: Columns) -> None:
    np.savez(path, **columns)  # type: ignore[arg-type]


def save_parquet(path: Path, columns: Columns) -> None:
    pq.write_table(pa.table(dict(columns)), path)


def save_mat(path: Path, columns: Columns) -> None:
    from scipy.io import savemat

    groups: dict[str, Any] = {"time": TIME, "action": {}, "position": {}}
    for name, values in columns.items():
        group, _, joint = name.partition(".")
        groups |= {group: {**groups[group], joint: values}} if joint else {group: values}
    savemat(path, groups)


def save_hdf5(path: Path, columns: Columns) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.update(columns)


def save_json(path: Path, columns: Columns) -> None:
    path.write_text(json.dumps({name: values.tolist() for name, values in columns.items()}))


FORMATS: dict[str, Callable[[Path, Columns], Any]] = {
    "csv": csv,
    "npz": save_npz,
    "parquet": save_parquet,
    "mat": save_mat,
    "hdf5": save_hdf5,
    "json": save_json,
}


@pytest.mark.parametrize("end", FORMATS)
def test_a_renamed_joint_is_refused_with_its_pair_and_the_setting_that_helps(tmp_path: Path, end: str) -> None:
    FORMATS[end](tmp_path / f"log.{end}", renamed("action.elbow", "action.elbow_2"))
    line = refused("import", f"source=log.{end}", folder=tmp_path)
    pair = "'mapping.signals.action={column: {elbow: action.elbow_2, ...}}'"
    assert line == (
        f"log.{end}, column action.elbow_2: goes with position.elbow_2, which is missing; did you mean "
        f"position.elbow? Pair all: {pair}, or leave it out with mapping.joints=[shoulder]"
    )
    pairs = "mapping.signals.action={column: {shoulder: action.shoulder, elbow: action.elbow_2}}"
    batch = imported(tmp_path, f"log.{end}", pairs)
    order = [JOINTS.index(joint) for joint in batch.joints]  # HDF5 sorts by name
    assert sorted(order) == [0, 1]
    np.testing.assert_allclose(batch.episodes[0].action, ACTION[:-1, order], atol=1e-9)
    assert imported(tmp_path, f"log.{end}", "mapping.joints=[shoulder]", "force=true").joints == ("shoulder",)


def parse(typed: str) -> Any:
    """Return what Hydra makes of a setting as a message proposes it to the shell."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import QuotedString

    def plain_of(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain_of(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return list(map(plain_of, value))
        return value.text if isinstance(value, QuotedString) else value

    return plain_of(OverridesParser.create().parse_override(shlex.split(typed)[0]).value())


STRANGE = [
    "left knee",
    "a,b",
    "a]b",
    "x: y",
    "{j}",
    'say "x"',
    "it's",
    "back\\slash",
    "end\\",
    "élan",
    "1",
    "true",
    "-x",
    "",
]


def test_settings_that_a_message_proposes_can_be_typed() -> None:
    assert parse(spell_setting("mapping.joints", spell_list(STRANGE))) == STRANGE
    keys = {spell_key(name): name for name in STRANGE if spell_key(name)}
    assert list(keys.values()) == ["left knee", "a,b", "a]b", "x: y", "back\\slash", "end\\"]
    pairs = ", ".join(f"{key}: {spell(name)}" for key, name in keys.items())
    assert parse(spell_setting("k", f"{{{pairs}}}")) == {name: name for name in keys.values()}


def test_a_renamed_joint_with_a_blank_is_proposed_in_quotes(tmp_path: Path) -> None:
    columns = {name.replace("elbow", "left elbow").replace("shoulder", "a [1]"): v for name, v in plain().items()}
    csv(tmp_path / "log.csv", {name.replace("action.left elbow", "action.left elbo"): v for name, v in columns.items()})
    line = refused("import", "source=log.csv", folder=tmp_path)
    pair, joints = line.partition("Pair all: ")[2].split(", or leave it out with ")
    assert parse(pair.replace(", ...", "")) == {"column": {"left elbow": "action.left elbo"}}
    assert parse(joints) == ["a [1]"]


def test_names_without_end_are_compared_and_shown_in_part(tmp_path: Path) -> None:
    long = "elbow" * 20_000
    csv(tmp_path / "log.csv", {name.replace("elbow", f"{long}{name[:6]}"): v for name, v in plain().items()})
    begin = time.process_time()
    line = refused("import", "source=log.csv", folder=tmp_path)
    assert time.process_time() - begin < 5.0 and len(line) < 600
    assert line.endswith("? Rename it as its pair, or leave it out with mapping.joints=[shoulder]")
    names = [f"{number}{'a' * 131_000}" for number in range(10_000)]
    assert find_alike(names[7], names) == [names[7]]
    assert time.process_time() - begin < 10.0


ALONE = {
    "a position by another name": (
        renamed("position.elbow", "position.elbow_2"),
        "column action.elbow: goes with position.elbow, which is missing; did you mean position.elbow_2? ",
    ),
    "a command more": (
        {**plain(), "action.wrist": TIME},
        "column action.wrist: goes with position.wrist, which is missing; rename it as its pair, or leave it out "
        "with mapping.joints=[shoulder,elbow]",
    ),
    "a position more": (
        {**plain(), "position.wrist": TIME},
        "column position.wrist: goes with action.wrist, which is missing; rename it as its pair, or leave it out",
    ),
}


@pytest.mark.parametrize("name", ALONE)
def test_a_joint_that_has_a_command_or_a_position_alone_is_refused(tmp_path: Path, name: str) -> None:
    columns, words = ALONE[name]
    csv(tmp_path / "log.csv", columns)
    assert words in refused("import", "source=log.csv", folder=tmp_path)


def test_optional_signals_that_do_not_fit_the_joints_are_told(tmp_path: Path) -> None:
    csv(tmp_path / "log.csv", {**plain(), "velocity.shoulder": TIME, "velocity.elbw": TIME, "torque.wrist": TIME})
    said = gsl("import", "source=log.csv", "--check", folder=tmp_path).out
    assert "warning: velocity: left out, as there is no velocity.elbow; velocity.elbw is of no joint\n" in said
    assert "warning: torque: torque.wrist is of no joint that has positions, and left out\n" in said


def test_columns_of_a_closer_form_are_those_of_another_signal(tmp_path: Path) -> None:
    columns = {name.replace("action.", "q_des_").replace("position.", "q_"): v for name, v in plain().items()}
    csv(tmp_path / "log.csv", columns)
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"signals": {"action": "q_des_{joint}", "position": "q_{joint}"}}))
    assert imported(tmp_path, "log.csv", "mapping=m.yaml").joints == JOINTS


def test_a_renamed_joint_of_a_data_set_is_refused(tmp_path: Path) -> None:
    folder = write_data_set(tmp_path / "wave", "v3.0", recorded(degrees))
    names = [f"{name}.pos" for name in NAMES]
    others = [name.replace("elbow_flex", "elbow") for name in names]
    features = json.loads((folder / "meta/info.json").read_text())["features"]
    edit(folder, features={**features, "action": {**features["action"], "names": others}})
    line = refused("import", "source=wave", folder=tmp_path)
    joints = "shoulder_pan,shoulder_lift,wrist_flex,wrist_roll,gripper"
    assert line == (
        "wave, column action.elbow.pos: goes with observation.state.elbow.pos, which is missing; did you mean "
        "observation.state.elbow_flex.pos? Name both alike in meta/info.json, or leave it out with "
        f"mapping.joints=[{joints}]"
    )
    done("import", "source=wave", f"mapping.joints=[{joints}]", "name=log", folder=tmp_path)
    more = [*names[:5], "gripper.vel"]  # which no command has, and need not
    edit(folder, features={key: {**about, "names": names} for key, about in features.items() if key != "timestamp"})
    alike = json.loads((folder / "meta/info.json").read_text())["features"]
    edit(folder, features={**alike, "observation.state": {**features["observation.state"], "names": more}})
    assert "action.gripper.pos: goes with observation.state.gripper.pos" in refused(
        "import", "source=wave", folder=tmp_path
    )
    edit(folder, features={key: {**about, "names": more} for key, about in alike.items()})
    said = gsl("import", "source=wave", "--check", folder=tmp_path)
    assert said.code == 0 and "note: left out, as no joint's position: gripper.vel" in said.out


@pytest.mark.parametrize("end", FORMATS)
def test_a_hole_in_a_log_is_told_with_its_time(tmp_path: Path, end: str) -> None:
    late = {**plain(), "time": TIME + 30.0 * (np.arange(len(TIME)) >= 120) + 1.7e9}
    FORMATS[end](tmp_path / f"log.{end}", late)
    said = done("import", f"source=log.{end}", "name=log", folder=tmp_path)
    words = "log: has no row for 30 s after 1.19 s, and is cut into 2 episodes; mapping.longest_gap="
    assert f"warning: {words}" in said.err and words in " ".join(said.out.split())
    metrics = json.loads((tmp_path / "runs/log/import/metrics.json").read_text())
    assert any(line.startswith(words) for line in metrics["warnings"]) and metrics["episodes"] == 2
    whole = next(line for line in metrics["warnings"] if line.startswith(words)).split("; ")[1].split()[0]
    assert len(imported(tmp_path, f"log.{end}", whole, "force=true").episodes) == 1


def lines() -> bytes:
    return csv_text().encode()


def csv_text() -> str:
    rows = zip(*plain().values(), strict=True)
    return "\n".join([",".join(plain()), *(",".join(map(str, row)) for row in rows)]) + "\n"


def records() -> bytes:
    rows = zip(*plain().values(), strict=True)
    return b"".join(json.dumps(dict(zip(plain(), map(float, row), strict=True))).encode() + b"\n" for row in rows)


def without_end(save: Callable[[Path, Columns], Any], end: str) -> Callable[[Path], bytes]:
    def content(folder: Path) -> bytes:
        save(folder / f"whole.{end}", plain())
        whole = (folder / f"whole.{end}").read_bytes()
        (folder / f"whole.{end}").unlink()
        return whole[: len(whole) * 2 // 3]

    return content


def cut_array(folder: Path) -> bytes:
    file = io.BytesIO()
    np.save(file, np.column_stack(list(plain().values())))
    return file.getvalue()[:-100]


LAST = "; the file ends within this line, as that of a killed logger does: delete the line"
CUT: dict[str, tuple[Callable[[Path], bytes], str]] = {
    "few_cells.csv": (lambda _: lines()[:-30], ", column position.elbow, line 302: is not a finite number"),
    "half_a_number.csv": (
        lambda _: lines().rpartition(b",")[0] + b",1e-",
        ", column position.elbow, line 302: '1e-' is not a number",
    ),
    "a_quote.csv": (lambda _: lines() + b'"3.', ", line 303: has a quote that does not end"),
    "zeros.csv": (lambda _: lines() + bytes(40), ", column time, line 303: "),
    "record.jsonl": (lambda _: records()[:-30], ", line 301: is not JSON (Unterminated string starting at)"),
    "fields.jsonl": (lambda _: records() + b'{"time": 3.01}', ", column action.shoulder, line 302: is missing here"),
}
WHOLE: dict[str, tuple[Callable[[Path], bytes], str]] = {
    "cut.csv.gz": (lambda _: gzip.compress(lines())[:-100], "copy it again, or unpack what is whole with zcat"),
    "cut.json": (without_end(save_json, "json"), "copy it again, or log a record a line (.jsonl)"),
    "cut.parquet": (without_end(save_parquet, "parquet"), "copy it again, or log it again if its logger was killed"),
    "cut.npz": (without_end(save_npz, "npz"), "copy it again, or log it again if its logger was killed"),
    "cut.mat": (without_end(save_mat, "mat"), "copy it again, or log it again if its logger was killed"),
    "cut.hdf5": (without_end(save_hdf5, "hdf5"), "copy it again, or log it again if its logger was killed"),
    "cut.npy": (cut_array, "is damaged: mmap length is greater than file size; copy it again"),
}


@pytest.mark.parametrize("name", CUT)
def test_a_last_line_that_is_half_written_says_which_and_what_to_do(tmp_path: Path, name: str) -> None:
    content, words = CUT[name]
    (tmp_path / name).write_bytes(content(tmp_path))
    line = refused("import", f"source={name}", folder=tmp_path)
    assert line.startswith(f"{name}{words}") and line.endswith(LAST)
    kept = (tmp_path / name).read_bytes().rpartition(b"\n")[0] + b"\n"  # as an editor deletes it
    (tmp_path / name).write_bytes(kept)
    assert len(imported(tmp_path, name, "mapping=plain").episodes[0]) in (299, 300)


@pytest.mark.parametrize("name", WHOLE)
def test_a_file_that_ends_too_early_says_what_to_do(tmp_path: Path, name: str) -> None:
    content, words = WHOLE[name]
    (tmp_path / name).write_bytes(content(tmp_path))
    chosen = ["time: '0'", "joints: [shoulder, elbow]", "signals: {action: ['1', '2'], position: ['3', '4']}"]
    (tmp_path / "m.yaml").write_text("\n".join(chosen))
    more = ("mapping=m.yaml",) if name.endswith("npy") else ()
    line = refused("import", f"source={name}", *more, folder=tmp_path)
    assert line.startswith(f"{name}: ") and line.endswith(words)


def test_a_whole_file_is_not_called_cut(tmp_path: Path) -> None:
    text = csv_text().splitlines()
    text[5] = text[5].replace(",", ",x", 1)
    for end in ("", "\n"):
        (tmp_path / "log.csv").write_text("\n".join(text) + end)
        assert "ends within" not in refused("import", "source=log.csv", folder=tmp_path)


@pytest.mark.parametrize("filling", [b"\n", b"\0"])
def test_what_follows_a_line_is_not_unpacked(tmp_path: Path, filling: bytes) -> None:
    path, packed = tmp_path / "log.csv.gz", gzip.compress(filling * 10_000_000)
    path.write_bytes(gzip.compress(lines()) + packed * 1000)  # 10 GB
    begin = time.process_time()
    assert not is_open_line(path, 5)
    assert not is_open_line(path, 303)
    assert time.process_time() - begin < 2.0
    path.write_bytes(gzip.compress(lines() + b"3.01,"))
    assert is_open_line(path, 303) and not is_open_line(path, 302)
