"""One log in every format of the how-to page: the script writes it, the page's command imports it, nothing changes."""

from __future__ import annotations

import importlib.util
import re
import runpy
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import done

from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCRIPT: dict[str, Any] = runpy.run_path(str(ROOT / "examples/formats.py"))
PAGE = (ROOT / "docs/howto/formats.md").read_text(encoding="utf-8")
NEEDS = {"hdf5": "h5py", "mcap": "rosbags", "rosbag2": "rosbags", "rosbag1": "rosbags"}


@pytest.mark.parametrize("name", SCRIPT["FORMATS"])
def test_a_log_comes_back_from_every_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    if name in NEEDS and importlib.util.find_spec(NEEDS[name]) is None:
        pytest.skip(f"{NEEDS[name]} is not installed")
    monkeypatch.chdir(tmp_path)
    words = SCRIPT["write"](Path("formats"), name)
    (command,) = re.findall(rf"^\| .* \| `(source=formats/{name}\b.*)` \|$", PAGE, re.MULTILINE)
    assert [word for word in shlex.split(command) if "..." not in word] == [
        word for word in words if "joints" not in word
    ]
    done("import", "name=log", *words, folder=tmp_path)
    episode = read(tmp_path / "runs/log/import/trajectories.parquet").episodes[0]
    if name.startswith("lerobot"):  # its degrees are of 4095 steps, and its stamps frame numbers
        np.testing.assert_allclose(episode.position[:, :5], SCRIPT["read_motion"]().position[:, :5], rtol=3e-4)
        return
    log = SCRIPT["read_chirp"]()
    np.testing.assert_allclose(episode.time, log.time - log.time[0], atol=1e-6)
    np.testing.assert_allclose(episode.position, log.position, atol=1e-14)
    np.testing.assert_allclose(episode.action, log.action[:-1], atol=1e-14)


def test_the_script_leaves_out_what_lacks_its_library_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(tmp_path / "formats")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(SystemExit, match="1"):
        SCRIPT["main"]([folder, "hdf5", "csv"])
    out, err = capsys.readouterr()
    assert "name=csv" in out and "hdf5 is left out" in err and "pip install 'gsl[hdf5]'" in err
    assert not (tmp_path / "formats/hdf5").exists()  # so that it can be written once the library is there
    with pytest.raises(SystemExit, match="exists; move it"):
        SCRIPT["main"]([folder, "csv"])
