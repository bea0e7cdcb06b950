"""A multirun is one command as many jobs, run by any sweeper and launcher of hydra; each has its own artifact."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from joblib import register_parallel_backend
from joblib._parallel_backends import LokyBackend
from omegaconf import DictConfig, OmegaConf

from gsl.commandline.composer import Composition
from gsl.commandline.config import RUNS, execute, resolve
from gsl.commandline.failure import describe_failure, report
from gsl.commandline.hydra_door import OtherConfiguration
from gsl.commandline.known_settings import plain
from gsl.commandline.overrides import file_of, key_of
from gsl.commandline.own_word import check_own_word, check_servos
from gsl.core.interruption import end_with_parent
from gsl.errors import GslError
from gsl.report.console import Console
from gsl.storage.documents import write_json
from gsl.storage.leftovers import hold

RESULT = "result.json"
AT_WORK = "."  # how the name of hydra's folder begins while jobs run
LONGEST_LEVEL = 100
_SILENT = ("hydra/job_logging=none", "hydra/hydra_logging=none", "hydra.output_subdir=null")


def run_jobs(command: str, line: str, composition: Composition, console: Console) -> int:
    """Run all jobs and return the worst of their exit codes; a job that fails does not stop the others.

    Raises:
        GslError: A process of the launcher died.
    """
    with _sweep_folder(file_of(command)) as folder:
        _launch(command, line, composition, folder, json=console.json)
        return _report_jobs(folder, console)


@contextlib.contextmanager
def _sweep_folder(command: str) -> Iterator[Path]:
    """Yield hydra's folder; it stays for what launchers write of failed jobs, and goes otherwise, after a kill at last.

    It is locked while it is in use, so that the next multirun sees which ones nobody uses any more.
    """
    place = RUNS / ".multirun"
    with contextlib.ExitStack() as locks:
        with hold(Path(), wait=True):  # two multiruns that start at once
            place.mkdir(parents=True, exist_ok=True)
            for left in place.glob(f"{AT_WORK}*"):
                with hold(left) as unused:
                    if unused:
                        shutil.rmtree(left, ignore_errors=True)
            folder = Path(tempfile.mkdtemp(prefix=f"{AT_WORK}{command}-", dir=place))
            locks.enter_context(hold(folder))
        try:
            yield folder
            if any(outcome["exit_code"] for outcome in _outcomes(folder)):
                folder.rename(folder.with_name(folder.name.removeprefix(AT_WORK)))
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            for emptied in (place, RUNS):
                with contextlib.suppress(OSError):
                    emptied.rmdir()


def _launch(command: str, line: str, composition: Composition, folder: Path, *, json: bool) -> None:
    job = functools.partial(
        run_job,
        command=command,
        line=line,
        swept=composition.swept,
        trust=composition.trust,
        json=json,
        place=OtherConfiguration.folder,
    )
    hydra = GlobalHydra.instance().hydra
    assert hydra is not None
    # Processes of hydra's own launcher would outlive a kill -9 of this one.
    register_parallel_backend(
        "loky", functools.partial(LokyBackend, initializer=end_with_parent, initargs=(os.getpid(),))
    )
    try:
        hydra.multirun(
            config_name=file_of(command),
            task_function=job,
            overrides=[
                *_SILENT,
                f"hydra.sweep.dir={folder}",
                "hydra.sweep.subdir=${hydra.job.num}",
                *composition.overrides,
            ],
            with_log_configuration=False,
        )
    except BrokenProcessPool as error:
        raise GslError("a process of the launcher died; the same command goes on from what is built") from error


def run_job(
    config: DictConfig, *, command: str, line: str, swept: Sequence[str], trust: Sequence[str], json: bool,
    place: Path | None,
) -> Any:  # fmt: skip
    """Run one job, leave its outcome in hydra's folder and return the figure that a sweeper may look at.

    `place` is the folder of the user's yaml files, if there is one; the job may run in a process of a launcher.
    """
    console = Console(json=json)
    hydra = HydraConfig.get()
    level = job_level(list(hydra.overrides.task), swept, int(hydra.job.num))
    console.status(f"job {hydra.job.num}: {level}")
    try:
        typed = list(hydra.overrides.task)
        check_own_word(plain(config), {key_of(word) for word in typed})  # a job may be of other files
        OmegaConf.set_struct(config := config.copy(), False)  # hydra's refuses to be asked for what it does not say
        check_servos(config, typed, place)
        values = resolve(Composition(config, (), {}, ()))
        outcome = {"job": level, "exit_code": 0, **execute(command, line, values, console, trust=trust, level=level)}
    except Exception as failure:
        message, _ = describe_failure(failure)
        outcome = {"job": level, "exit_code": report(failure, Console(), command=f"gsl {command}"), "error": message}
    write_json(Path(hydra.runtime.output_dir) / RESULT, outcome)
    return outcome.get("metrics", {}).get("objective")


def job_level(overrides: Sequence[str], swept: Sequence[str], number: int) -> str:
    """Return the folder name of a job: what is particular about it, or its number where that gets long."""
    own = [re.sub(r"^[\w/]+@", "", override.lstrip("+")) for override in overrides if key_of(override) in swept]
    name = re.sub(r"[^\w.,=@+-]", "_", ",".join(own))
    return name if 0 < len(name) <= LONGEST_LEVEL else str(number)


def _report_jobs(folder: Path, console: Console) -> int:
    """Say what became of the jobs and return the worst exit code."""
    outcomes = _outcomes(folder)
    worst = max((int(outcome["exit_code"]) for outcome in outcomes), default=0)
    console.table("jobs", ["job", "folder", "outcome"], [_row(outcome) for outcome in outcomes])
    console.result({"jobs": outcomes, "exit_code": worst})
    return worst


def _outcomes(folder: Path) -> list[dict[str, Any]]:
    files = sorted(folder.glob(f"*/{RESULT}"), key=lambda path: int(path.parent.name))
    return [json.loads(path.read_text(encoding="utf-8")) for path in files]


def _row(outcome: Mapping[str, Any]) -> tuple[str, str, str]:
    done = "unchanged" if outcome.get("unchanged") else "done"
    return outcome["job"], outcome.get("folder", "-"), outcome.get("error", done)
