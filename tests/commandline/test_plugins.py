"""Commands of other packages: the example of docs/howto/own-components.md, broken ones, and what stays as it is."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path

import pytest
from commands import done, gsl, refused

import gsl as python

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"```\w+\n# (\S+)\n(.*?)```", re.DOTALL)
OTHERS = {
    "broken.py": "import no_such_library\n",
    "unclosed.py": "def (\n",
    "leaving.py": "raise SystemExit(3)\n",
    "number.py": '"""Is no command."""\n\nvalue = 3\n',
    "tools.py": '''"""Small tools."""

import typer

app = typer.Typer()


@app.command()
def hello(name: str = "robot") -> None:
    """Say hello."""
    raise typer.Exit(len(name))


@app.command()
def again() -> None:
    """Say it again."""


def count(of: int = 3) -> None:
    """Count."""
    raise typer.Exit(of)
''',
}
ENTRY_POINTS = {
    "collect": "others.number:value",
    "odd": "no module: at all!",
    "missing": "not_installed.commands:app",
    **{name: f"others.{name}:app" for name in ("broken", "unclosed", "leaving", "tools")},
    "number": "others.number:value",
    "count": "others.tools:count",
}


def install(folder: Path, name: str, commands: dict[str, str]) -> None:
    """Leave the traces in `folder` that an installation of a package leaves."""
    place = folder / f"{name}-1.0.dist-info"
    place.mkdir(parents=True)
    (place / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = "\n".join(f"{command} = {value}" for command, value in commands.items())
    (place / "entry_points.txt").write_text(f"[gsl.commands]\n{lines}\n")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of packages: that of the page, and one of which most is broken."""
    page = (ROOT / "docs/howto/own-components.md").read_text(encoding="utf-8").partition("## A command")[2]
    blocks = dict(BLOCK.findall(page))
    packages = tmp_path / "packages"
    for name, text in {**blocks, **{f"others/{file}": code for file, code in OTHERS.items()}}.items():
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).write_text(text, encoding="utf-8")
    for package in ("my_gsl", "others"):
        (packages / package / "__init__.py").touch()
    project = tomllib.loads((packages / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    install(packages, "my_gsl", project["entry-points"]["gsl.commands"])
    install(packages, "others", ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(packages))
    for name in [name for name in sys.modules if name.partition(".")[0] in ("my_gsl", "others")]:
        monkeypatch.delitem(sys.modules, name)
    return packages


def listed(said: str) -> dict[str, str]:
    """Commands of a help and what it says of each."""
    lines = said.partition("Commands:\n")[2].splitlines()
    return {line.split()[0]: " ".join(line.split()[1:]) for line in lines if re.match(r"  \w", line)}


def test_help_names_a_command_before_its_package_is_imported(place: Path) -> None:
    commands = listed(done("--help", folder=place).out)
    assert commands["reach"] == "Say how far each joint moves in trajectories [rad]."
    assert not [name for name, line in commands.items() if line.endswith("...")]
    assert (commands["tools"], commands["count"], commands["broken"]) == ("Small tools.", "Count.", "")
    assert {"my_gsl.reach", "my_gsl", "others.tools", "others.number"} & sys.modules.keys() == set()


def test_a_command_of_a_stage_makes_an_artifact(place: Path, chain: Path, tmp_path: Path) -> None:
    data = f"data={chain / 'runs/chain/collect_real'}"
    assert done("reach", data, "name=mine", folder=tmp_path).out.endswith("runs/mine/reach\n")
    reach = json.loads((tmp_path / "runs/mine/reach/metrics.json").read_text())
    assert len(reach) > 10 and all(0.0 <= value < 4.0 for value in reach.values())
    done("reach", data, "name=less", "share=0.5", folder=tmp_path)
    less = json.loads((tmp_path / "runs/less/reach/metrics.json").read_text())
    assert all(less[name] <= reach[name] for name in reach)


def test_an_edit_of_any_file_of_its_package_is_noticed(place: Path, chain: Path, tmp_path: Path) -> None:
    command = ("reach", f"data={chain / 'runs/chain/collect_real'}", "name=mine")
    done(*command, folder=tmp_path)
    assert "(unchanged)" in done(*command, folder=tmp_path).out
    (place / "my_gsl/other.py").write_text("value = 1\n")
    assert "changed: gsl itself" in refused(*command, folder=tmp_path)


def test_an_edit_of_its_settings_is_noticed_by_the_next_command(place: Path, tmp_path: Path) -> None:
    path = place / "my_gsl/conf/reach.yaml"
    assert "share: 1.0\n" in done("reach", "data=x", "--cfg", "job", folder=tmp_path).out
    path.write_text(path.read_text().replace("share: 1.0", "share: 0.5"))  # of the same length
    assert "share: 0.5\n" in done("reach", "data=x", "--cfg", "job", folder=tmp_path).out
    path.unlink()
    assert "reach" in gsl("reach", "data=x", "--cfg", "job", folder=tmp_path).lines[-1]


def test_its_settings_have_help_bounds_and_hints(place: Path, tmp_path: Path) -> None:
    assert "of the time that counts" in done("reach", "--help", folder=tmp_path).out
    assert refused("reach", "data=x", "share=2", folder=tmp_path) == "share = 2: must be at most 1"
    assert refused("reach", "data=x", "shar=1", folder=tmp_path) == "shar: no such setting; did you mean share?"
    assert refused("reach", folder=tmp_path) == "data: has no value yet; say data=..."


def test_python_runs_it_as_well(place: Path, chain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "LKneePitch" in python.run("reach", data=str(chain / "runs/chain/collect_real")).metrics


def test_functions_and_groups_are_commands_too(place: Path, tmp_path: Path) -> None:
    assert gsl("count", "--of", "5", folder=tmp_path).code == 5
    assert gsl("tools", "hello", "--name", "four", folder=tmp_path).code == 4
    assert listed(done("tools", "--help", folder=tmp_path).out) == {"hello": "Say hello.", "again": "Say it again."}
    said = gsl("tools", "helo", folder=tmp_path)
    assert (said.code, said.err) == (2, "gsl tools helo: No such command 'helo'. Did you mean 'hello'?\n")


@pytest.mark.parametrize(
    ("name", "module", "why"),
    [
        ("broken", "others.broken:app", "ModuleNotFoundError: No module named 'no_such_library'; "),
        ("unclosed", "others.unclosed:app", "SyntaxError: "),
        ("leaving", "others.leaving:app", "SystemExit: 3; "),
        ("missing", "not_installed.commands:app", "ModuleNotFoundError: No module named 'not_installed'; "),
        ("number", "others.number:value", "TypeError: "),
        ("odd", "no module: at all!", ""),
    ],
)
def test_a_broken_command_says_why_in_one_line(name: str, module: str, why: str, place: Path, tmp_path: Path) -> None:
    said = refused(name, "a=b", folder=tmp_path, code=1)
    assert said.startswith(f"{module} of the package others cannot be loaded: {why}")
    assert said.endswith("; repair that package or uninstall it")


def test_what_is_broken_or_of_the_same_name_changes_nothing_of_ours(place: Path, tmp_path: Path) -> None:
    assert listed(done("--help", folder=tmp_path).out)["collect"] == "Record trajectories of a policy in a world."
    assert "_target_: gsl.stages.collect.Collect" in done("collect", "--cfg", "job", folder=tmp_path).out
    assert refused("coun", folder=tmp_path) == "No such command 'coun'. Did you mean 'count'?"


def test_those_of_the_repository_are_there(tmp_path: Path) -> None:
    commands = listed(done("--help", folder=tmp_path).out)
    assert {"reproduce", "compare", "blind", "bench"} <= commands.keys()
    assert all(commands[name].endswith(".") for name in ("reproduce", "compare", "blind", "bench"))
