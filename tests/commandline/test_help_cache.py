"""Help is kept on disk as long as nothing that it is made of has changed, and written anew where it was damaged."""

from pathlib import Path

import pytest

from gsl.commandline.help_cache import read_or_write


class Writer:
    """Counts how often it writes."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> str:
        self.count += 1
        return f"help number {self.count}\n"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "gsl"


def test_help_is_written_once_for_what_is_typed(home: Path) -> None:
    write = Writer()
    assert read_or_write("iterate", [], write) == read_or_write("iterate", [], write) == "help number 1\n"
    assert read_or_write("iterate", ["world=nao_worn"], write) == "help number 2\n"
    assert read_or_write("collect", [], write) == "help number 3\n"


def test_a_damaged_help_is_written_again(home: Path) -> None:
    write = Writer()
    read_or_write("iterate", [], write)
    (place,) = home.iterdir()
    place.write_text(place.read_text().replace("number", "nonsense"))
    assert read_or_write("iterate", [], write) == "help number 2\n"
    assert [path.name for path in home.iterdir()] == [place.name]


@pytest.mark.parametrize("word", ["robot=mine.urdf", "policy._target_=mine.Policy", "trust=a.b"])
def test_what_names_files_or_classes_is_not_kept(home: Path, word: str) -> None:
    write = Writer()
    read_or_write("iterate", [word], write)
    read_or_write("iterate", [word], write)
    assert write.count == 2 and not home.exists()


def test_a_home_that_cannot_be_written_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert read_or_write("iterate", [], Writer()) == "help number 1\n"
