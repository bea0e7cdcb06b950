"""Robots of robot_descriptions: what its text says is found on disk, and nothing of it runs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gsl.core.trust import modules_in
from gsl.errors import ConfigError, GslError, InputError
from gsl.robots.catalogue import files, robot
from gsl.robots.descriptions import PREFIX, find_description

EXAMPLE = Path(__file__).parents[2] / "examples/arm.urdf"
REPOSITORIES = """
from nowhere import nothing
REPOSITORIES = {
    "arms": Repository(url="https://example.org/arms.git", commit="1", cache_path="arms_repository"),
}
"""
ARM = """
raise SystemExit("this is never run")
from ._cache import clone_to_cache as _clone_to_cache
REPOSITORY_PATH: str = _clone_to_cache("arms", commit=_getenv("COMMIT", None))
PACKAGE_PATH: str = _path.join(REPOSITORY_PATH, "robots", "arm")
URDF_PATH: str = _path.join(PACKAGE_PATH, "arm.urdf")
"""
XACRO = """
REPOSITORY_PATH: str = _clone_to_cache("arms")
XACRO_PATH: str = _path.join(REPOSITORY_PATH, "arm.xacro")
URDF_PATH: str = _expand(XACRO_PATH)
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of that name, and its cache with the arm's URDF."""
    place = tmp_path / "site/robot_descriptions"
    place.mkdir(parents=True)
    for name, text in (
        ("__init__", "raise SystemExit('this is never run')"), ("_repositories", REPOSITORIES),
        ("arm_description", ARM), ("xacro_description", XACRO),
    ):  # fmt: skip
        (place / f"{name}.py").write_text(text)
    home = tmp_path / "cache/arms_repository/robots/arm"
    home.mkdir(parents=True)
    (home / "arm.urdf").write_text(EXAMPLE.read_text())
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    return place


@pytest.mark.parametrize("word", ["arm", "arm_description"])
def test_a_robot_is_read_from_the_cache(package: Path, word: str, tmp_path: Path) -> None:
    name = f"{PREFIX}{word}"
    assert robot(name).controlled == robot(str(EXAMPLE)).controlled
    assert files(name)[0] == tmp_path / "cache/arms_repository/robots/arm/arm.urdf"
    assert "robot_descriptions" not in sys.modules and modules_in({"robot": name}) == ()
    own = tmp_path / "robot.yaml"
    own.write_text(f"urdf: {name}\njoints: {{elbow: }}\n")
    assert robot(str(own)).controlled == ("elbow",)


def test_the_usual_cache_is_below_home(package: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("ROBOT_DESCRIPTIONS_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path / "me"))
    (tmp_path / "me/.cache").mkdir(parents=True)
    (tmp_path / "cache").rename(tmp_path / "me/.cache/robot_descriptions")
    assert find_description(f"{PREFIX}arm").is_relative_to(tmp_path / "me/.cache")


def test_what_is_not_there_is_told_and_not_fetched(package: Path, tmp_path: Path) -> None:
    (tmp_path / "cache/arms_repository/robots/arm/arm.urdf").unlink()
    with pytest.raises(InputError, match="gsl downloads nothing; robot_descriptions pull arm_description brings it"):
        robot(f"{PREFIX}arm")
    with pytest.raises(InputError, match="no such robot; did you mean arm_description"):
        robot(f"{PREFIX}arn")
    with pytest.raises(InputError, match="says no file that is a URDF"):
        robot(f"{PREFIX}xacro")
    (package / "arm_description.py").write_text("URDF_PATH = (")
    with pytest.raises(InputError, match="is not the package that gsl knows how to read"):
        robot(f"{PREFIX}arm")


def test_without_the_package_its_name_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(GslError) as error:
        robot(f"{PREFIX}panda")
    assert str(error.value).endswith("needs the package: pip install robot_descriptions; or name a URDF file")
    with pytest.raises(ConfigError, match="a file such as arm.urdf, or robot_descriptions:NAME"):
        robot("panda")
