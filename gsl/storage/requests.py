"""Request folders: what a real robot is asked to run, with a runner and all its modules, written whole."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gsl.core.budget import holds
from gsl.core.trust import modules_in
from gsl.errors import ArtifactError
from gsl.runner.request import NAME, SCHEMA_VERSION, hash_of, read_stored
from gsl.storage import documents
from gsl.storage.answers import answer_files
from gsl.storage.bundle import RUNNER, bundle
from gsl.storage.whole import explain_refusal, flush_tree

MODULES, README, ROBOT = "modules", "README.txt", "robot.py"
_ENTRY = '''"""Plays the episodes of request.json on a robot; needs Python 3.10 or newer and numpy."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "modules"))

from gsl.runner.process import run  # noqa: E402

run(HERE, sys.argv[1:])
'''
_TEMPLATE = '''"""Your robot: fill in read and send, or name another file of this kind with --robot."""

# Of your robot: lower, upper [rad], speed [rad/s]. No target goes beyond, whatever a request allows; check them.
LIMITS = {{
{limits}
}}
# TIME_LIMIT = 2.0  # [s], after which read() or send() is given up


def read():
    """Return what the robot measures now, SI units, joints in the order of request.json.

    "position" and, if there are any, "velocity" of the joints; {observes}.
    More if you have it: "base.position" (3), "base.orientation" (x, y, z, w), "base.velocity" (3), "acceleration" (3),
    "torque", "temperature" (one a joint), "voltage"; "fell": True once the robot lies down, which ends the episode.
    """
    raise RuntimeError("it is still to be filled in, for your robot")


def send(targets):
    """Hand desired joint positions [rad] to the servos, joints in the order of request.json; return at once."""
    raise RuntimeError("it is still to be filled in, for your robot")


# All of them are called in one thread, which is not the one that has loaded this file.
# def begin(episode): called when the robot stands at the start, just before the first step
# def end(): called when it is back there
# At the end of Python, what atexit, threads or processes of this file still do has 2 s; then it is ended.
'''


def files_of(request: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the runner of a request and its modules, by path below the folder.

    Raises:
        ConfigError: The policy needs a library beside numpy.
    """
    tables = all("commands" in episode for episode in request["episodes"])
    policy = () if tables else (str(request["policy"]["_target_"]).rpartition(".")[0],)
    modules = {f"{MODULES}/{name}": source for name, source in bundle((RUNNER, *policy)).items()}
    return {"runner.py": _ENTRY.encode(), **modules}


def seal(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return a request in the types of JSON with its version and its hash."""
    plain = documents.plain({**request, "schema_version": SCHEMA_VERSION})
    return {**plain, "hash": hash_of(plain)}


def write_request(folder: Path, request: Mapping[str, Any], warnings: Sequence[str]) -> None:
    """Write the folder of a sealed request, in place of one that nobody has answered; what is not ours in it stays.

    Raises:
        ArtifactError: There is an answer to another request in it, a damaged request, or somebody's file in the way.
        ConfigError: The policy needs a library beside numpy.
        GslError: The folder cannot be written.
    """
    if answers := answer_files(folder):
        if not (folder / NAME).exists():
            raise ArtifactError(
                folder / NAME, "is missing beside an answer to it; put it back, or move the answer away"
            )
        read_stored(folder)
        raise ArtifactError(answers[0], "answers another request, which has changed since; move it away")
    files = files_of(request)
    with explain_refusal(folder.parent):
        temporary = folder.with_name(f".{folder.name}.tmp-{os.getpid()}")
        shutil.rmtree(temporary, ignore_errors=True)
        try:
            _write(temporary, request, files, warnings)
            _check_ours(folder, temporary)
            flush_tree(temporary)
            _put_in_place(temporary, folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def restore(folder: Path, request: Mapping[str, Any]) -> bool:
    """Write the runner and its modules anew where one of them is missing; tell whether that was so."""
    files = files_of(request)
    if all((folder / name).is_file() for name in files):
        return False
    with explain_refusal(folder):
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
    return True


def _check_ours(folder: Path, new: Path) -> None:
    """Refuse a folder with a request that is damaged, or without one and with files of our names that are not ours."""
    if (folder / NAME).exists():
        read_stored(folder)
        return
    for path in (path for path in sorted(new.rglob("*")) if path.is_file() and path.name != ROBOT):
        old = folder / path.relative_to(new)
        if old.exists() and not holds(old, path.read_bytes()):
            raise ArtifactError(old, "is in the way of a request, and not gsl's; move it, or choose another folder")


def _put_in_place(new: Path, folder: Path) -> None:
    """Move a folder to its place: as a whole, or file by file into one that is there, the request itself last."""
    if not folder.exists():
        os.rename(new, folder)
        return
    files = [path for path in new.rglob("*") if path.is_file() and path != new / NAME]
    for path in [*files, new / NAME]:
        to = folder / path.relative_to(new)
        if path != new / ROBOT or not to.exists():
            to.parent.mkdir(parents=True, exist_ok=True)
            os.replace(path, to)


def _write(folder: Path, request: Mapping[str, Any], files: Mapping[str, bytes], warnings: Sequence[str]) -> None:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    own = [f'"{name}" ({size})' for name, size in request["observes"].items() if name not in ("position", "velocity")]
    observes, limits = ", ".join(own) or "nothing else is needed", "\n".join(_limits(request))
    (folder / ROBOT).write_text(_TEMPLATE.format(observes=observes, limits=limits), encoding="utf-8")
    (folder / README).write_text(_readme(request, warnings), encoding="utf-8")
    text = json.dumps(request, indent=1, ensure_ascii=False, allow_nan=False)  # a policy may care for the order
    (folder / NAME).write_text(text + "\n", encoding="utf-8")


def _limits(request: Mapping[str, Any]) -> Iterator[str]:
    values = (request["limits"][name] for name in ("lower", "upper", "speed"))
    for joint, *numbers in zip(request["joints"], *values, strict=True):
        yield f"    {json.dumps(joint)}: ({', '.join(map(repr, numbers))}),"


def _readme(request: Mapping[str, Any], warnings: Sequence[str]) -> str:
    trust = "".join(f" --trust={module}" for module in modules_in(request["policy"]))
    joints = ", ".join(request["joints"])
    lines = [
        request["about"],
        "",
        f"Robot: {request['robot']}, {request['place']}; {1.0 / request['control_period']:g} targets a second.",
        f"Joints in order: {joints}",
        "",
        "1. fill in read() and send() of robot.py",
        f"2. python runner.py{trust} --dry-run      plays against a perfect robot: rates and extremes",
        f"3. python runner.py{trust}                plays on the robot, asks before every movement, writes answer.csv",
        "4. bring answer.csv (and returns.csv) back into this folder and type the gsl command again",
        "",
        *(["Beware:", *(f"- {warning}" for warning in warnings), ""] if warnings else []),
    ]
    return "\n".join(lines)
