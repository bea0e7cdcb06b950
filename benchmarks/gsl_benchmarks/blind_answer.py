"""Answer a blind benchmark: diagnose every case from its log, with no access to labels, and seal what was said."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from gsl.core.console import Console, Progress
from gsl.core.setting import component, setting
from gsl.core.step_metrics import note_step
from gsl.core.validation import make
from gsl.diagnosis.log.files import check_log, on_ground
from gsl.diagnosis.options import Chance, Options
from gsl.rollout.parallel import Workers, arriving
from gsl.storage import documents
from gsl.storage.hashing import file_hash
from gsl.storage.records import Records
from gsl.storage.trajectories import read
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.blind.answer import Question, answer_by_baselines, answer_question
from gsl_benchmarks.blind.files import (
    ANSWERS,
    BASELINES,
    CASE,
    CASES,
    LOG,
    REFERENCE,
    SEAL,
    SEALS,
    answers_below,
    document,
    find,
    read_case,
    seals_of,
)
from gsl_benchmarks.blind.results import OURS
from gsl_benchmarks.blind.seals import VERSION, total

ANSWERED = "answered.jsonl"
"""What a run that was stopped goes on from: the cases that have an answer, with the hashes of its files."""


class _Task(NamedTuple):
    """A case to answer: its folder, the answers' folder, and what chance is known to gain there."""

    case: Path
    folder: Path
    chances: tuple[Chance, ...]


@component
class BlindAnswer:
    """Every answer is a file; a run that was stopped goes on with the cases that have none.

    What chance gains is measured once for each set of commands, on its first case, and used for the others.
    """

    kind: ClassVar[str] = "blind_answer"
    progress: ClassVar[str] = ANSWERED
    kept: ClassVar[tuple[str, ...]] = (ANSWERS, BASELINES)

    data: Annotated[str, setting("folder of the cases, of gsl blind make or of one's own", min_length=1)]
    baselines: Annotated[bool, setting("answer with four simpler methods as well")] = False
    most: Annotated[int, setting("effects at once, at most", ge=1, le=6)] = 4
    duels: Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)] = 2
    nulls: Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)] = 3
    workers: Workers = -1
    trust: Annotated[tuple[str, ...], setting("modules of your own whose robots the cases may name")] = ()

    def parents(self) -> Mapping[str, Path]:
        """Return the seals of the data, which hold the hash of every file of it."""
        return {"data": find(self.data, SEALS, "blind_make")}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write an answer for each case, and the hash of all."""
        seals = self.parents()["data"]
        cases = [seals.parent / CASES / name for name in seals_of(seals)]
        answered = Records(folder / ANSWERED, console.status)
        _drop_unrecorded(folder, answered, console)
        (folder / ANSWERS).mkdir(exist_ok=True)
        leaders = _leaders(cases) if self.nulls else {case: case for case in cases}
        with console.progress(len(cases), "answering") as progress:
            self._all(set(leaders.values()), {}, folder, answered, progress)
            self._all(set(cases), leaders, folder, answered, progress)
        answers = [document(_file(folder, case)) for case in cases]
        hashes = answers_below(folder)
        sealed = {"schema_version": VERSION, "data": file_hash(seals), "answers": hashes, "total": total(hashes)}
        documents.write_json(folder / SEAL, sealed)
        (folder / ANSWERED).unlink()  # its order is that in which the answers came
        words = [answer["verdict"] for answer in answers]
        return {
            "cases": len(answers),
            "verdicts": {word: words.count(word) for word in sorted(set(words))},
            "seal": sealed["total"],
        }

    def _all(
        self, cases: Iterable[Path], leaders: Mapping[Path, Path], folder: Path, answered: Records, progress: Progress
    ) -> None:
        """Answer the cases that have no answer yet; those with a leader use what chance gained there."""
        missing = [case for case in sorted(cases) if not _file(folder, case).exists()]
        tasks = [_Task(case, folder, _chances(folder, leaders.get(case))) for case in missing]
        options = Options(most=self.most, duels=self.duels, nulls=self.nulls, threads=1)
        shared = options, self.baselines, self.trust
        for index, (hashes, seconds) in arriving(_answer, shared, tasks, self.workers, progress):
            answered.append(hashes)
            note_step(missing[index].name, 1, **seconds)


def _drop_unrecorded(folder: Path, answered: Records, console: Console) -> None:
    """Remove answers that nobody wrote down, as of a worker that was killed, or that are no longer what was."""
    hashes = {name: sha for record in answered.records for name, sha in record.items()}
    wrong = [
        path
        for place in (ANSWERS, BASELINES)
        for path in sorted((folder / place).rglob("*.json"))
        if hashes.get(path.relative_to(folder).as_posix()) != file_hash(path)
    ]
    for path in wrong:
        path.unlink()
    if wrong:
        console.status(f"{len(wrong)} answers are not as they were written down; they are given again")


def _leaders(cases: Sequence[Path]) -> dict[Path, Path]:
    """Return for each case the first one with the same commands, simulator and manner of calibration.

    One that has the whole library leads before one that has not.
    """
    asked = {case: document(case / CASE) for case in cases}
    first: dict[str, Path] = {}
    leaders = {}
    for case in sorted(cases, key=lambda path: (bool(asked[path].get("without")), path)):
        log = read(case / LOG)
        digest = hashlib.sha256(
            documents.text([asked[case]["sim"], (case / REFERENCE).exists(), on_ground(log)]).encode()
        )
        for episode in log.episodes:
            digest.update(np.round(episode.action, 6).tobytes())
        leaders[case] = first.setdefault(digest.hexdigest(), case)
    return leaders


def _chances(folder: Path, leader: Path | None) -> tuple[Chance, ...]:
    return () if leader is None else tuple(Chance(*done) for done in document(_file(folder, leader))["chances"])


def _file(folder: Path, case: Path) -> Path:
    return folder / ANSWERS / f"{case.name}.json"


def _answer(frozen: bytes, task: _Task) -> tuple[dict[str, str], dict[str, float]]:
    """Answer one case; its own answer says that the case is done.

    Returns:
        The hashes of the files by name, and the time that each answer took [s] by the name of who gave it.
    """
    options, baselines, trust = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    question, without = _question(task.case, trust)
    asked = replace(options, without=tuple(without))
    files, seconds = [], {}
    for name, (answer, took) in (answer_by_baselines(question, asked, _quiet) if baselines else {}).items():
        (task.folder / BASELINES / name).mkdir(parents=True, exist_ok=True)
        files.append(task.folder / BASELINES / name / f"{task.case.name}.json")
        documents.write_json(files[-1], answer)
        seconds[name] = took
    begin = time.perf_counter()
    answer = answer_question(question, asked, chances=task.chances, tick=_quiet)
    seconds[OURS] = time.perf_counter() - begin
    files.append(_file(task.folder, task.case))
    documents.write_json(files[-1], answer)
    return {path.relative_to(task.folder).as_posix(): file_hash(path) for path in files}, seconds


def _question(folder: Path, trust: tuple[str, ...]) -> tuple[Question, list[str]]:
    log, reference, asked = read_case(folder, trust)
    world = make(BulletWorld, asked["sim"], where=f"{folder.name}.sim")
    question = Question(log, reference, world.plant, world.step, on_ground(log))
    check_log(log, question.robot, str(folder))
    return question, list(asked.get("without", []))


def _quiet(said: str = "") -> None:
    """Say nothing of the work inside a case."""
