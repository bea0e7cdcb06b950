"""Blind benchmarks of strangers: what is handed out names no code and no other folder, and answers may be anything."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import gsl

from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import ArtifactError, ConfigError
from gsl.storage.trajectories import write
from gsl_benchmarks.blind.files import CASE, CASES, LOG, SEALS, document, read_case, seals_of
from gsl_benchmarks.blind.seals import files_below


def case(folder: Path, **sim: Any) -> Path:
    """Write a case and its seal, whose hashes are right; return the folder of the data."""
    place = folder / "data" / CASES / "first"
    place.mkdir(parents=True)
    still = np.zeros((20, 1))
    episode = Trajectory(time=0.01 * np.arange(20), action=still[1:], position=still, velocity=still)
    write(place / LOG, Batch((episode,), ("a",), 0.01, {"robot": "r", "role": "real"}))
    (place / CASE).write_text(json.dumps({"sim": {"robot": "nao", "effects": {}, **sim}}))
    seals = {"cases": {"first": {"files": files_below(place), "label": "0"}}}
    (folder / "data" / SEALS).write_text(json.dumps(seals))
    return folder / "data"


@pytest.mark.parametrize("robot", ["evil.arm", "os.getcwd", "gsl.__main__.main"])
def test_a_case_names_no_code(robot: str, tmp_path: Path) -> None:
    data = case(tmp_path, robot=robot)
    with pytest.raises(ConfigError, match="is code that is not gsl's|is of Python's own library"):
        read_case(data / CASES / "first")


@pytest.mark.slow
def test_the_command_ends_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "evil.py").write_text("from pathlib import Path\nPath('ran').touch()\n\n\ndef arm():\n    pass\n")
    case(tmp_path, robot="evil.arm")
    said = gsl("blind", "answer", "data=data", "nulls=0", "workers=1", folder=tmp_path)
    assert (said.code, "is code that is not gsl's" in said.err) == (2, True), said
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("name", ["../first", "/etc", "..", ".hidden", "a/b"])
def test_a_seal_is_of_a_case_beside_it(name: str, tmp_path: Path) -> None:
    path = case(tmp_path) / SEALS
    stored = json.loads(path.read_text())
    path.write_text(json.dumps({"cases": {name: stored["cases"]["first"]}}))
    with pytest.raises(ArtifactError, match="no name of a case"):
        seals_of(path)


@pytest.mark.parametrize("text", ["[]", "5", "[" * 5000, '{"cases": 5}', '{"cases": {"first": 5}}', "{}"])
def test_seals_that_are_none_are_one_line(text: str, tmp_path: Path) -> None:
    path = case(tmp_path) / SEALS
    path.write_text(text)
    with pytest.raises(ArtifactError):
        seals_of(path)
    with pytest.raises(ArtifactError):
        document(path, cases=dict, more=str)
