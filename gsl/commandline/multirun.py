"""A multirun is one command as many jobs, run by any sweeper and launcher of hydra; each has its own artifact."""

from __future__ import annotations

import contextlib
import functools
import json
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from gsl.commandline.composer import Composition
from gsl.commandline.config import RUNS, execute, resolve
from gsl.commandline.failure import describe_failure, report
from gsl.commandline.overrides import file_of, key_of
from gsl.report.console import Console
from gsl.storage.documents import write_json

RESULT = "result.json"
LONGEST_LEVEL = 100
_SILENT = ("hydra/job_logging=none", "hydra/hydra_logging=none", "hydra.output_subdir=null")


def run_jobs(command: str, line: str, composition: Composition, console: Console) -> int:
    """Run all jobs and return the worst of their exit codes; a job that fails does not stop the others."""
    (RUNS / ".multirun").mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=f"{file_of(command)}-", dir=RUNS / ".multirun"))
    job = functools.partial(
        run_job,
        command=command,
        line=line,
        swept=composition.swept,
        trust=composition.trust,
        json=console.json,
    )
    hydra = GlobalHydra.instance().hydra
    assert hydra is not None
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
    return _report_jobs(folder, console)


def run_job(
    config: DictConfig, *, command: str, line: str, swept: Sequence[str], trust: Sequence[str], json: bool
) -> Any:
    """Run one job, leave its outcome in hydra's folder and return the figure that a sweeper may look at."""
    console = Console(json=json)
    hydra = HydraConfig.get()
    level = job_level(list(hydra.overrides.task), swept, int(hydra.job.num))
    console.status(f"job {hydra.job.num}: {level}")
    try:
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
    """Say what became of the jobs and return the worst exit code; hydra's folder stays where one failed."""
    files = sorted(folder.glob(f"*/{RESULT}"), key=lambda path: int(path.parent.name))
    outcomes = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    worst = max((int(outcome["exit_code"]) for outcome in outcomes), default=0)
    if worst == 0:
        shutil.rmtree(folder)
        with contextlib.suppress(OSError):
            folder.parent.rmdir()
    console.table("jobs", ["job", "folder", "outcome"], [_row(outcome) for outcome in outcomes])
    console.result({"jobs": outcomes, "exit_code": worst})
    return worst


def _row(outcome: Mapping[str, Any]) -> tuple[str, str, str]:
    done = "unchanged" if outcome.get("unchanged") else "done"
    return outcome["job"], outcome.get("folder", "-"), outcome.get("error", done)
