"""What a person reads after `iterate`: table, verdict, learning curve."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gsl.core.interfaces import Task
from gsl.core.unit import Unit, format_gain
from gsl.core.words import falls
from gsl.report.evaluation_cells import ends, format_ends, name_policy
from gsl.report.flight import Flight
from gsl.report.learning_curve import Search, learning_curve, search
from gsl.report.markdown import table
from gsl.report.run_page import Answer, describe_gain
from gsl.storage.artifact import Artifact
from gsl.storage.policy_choice import EVALUATION

CURVE, MARKDOWN = "learning_curve.png", "table.md"


class Rounds:
    """The iterations so far: which policy is the best, what it cost, and what to tell."""

    def __init__(self, task: Task) -> None:
        self._unit = Unit.of(task)
        self._done: list[Artifact] = []
        self._beside: Artifact | None = None
        self._flight: Flight | None = None
        self._spent = 0
        self._collected = 0
        self._refusal = ""
        self.rows: list[tuple[str, ...]] = []
        self.best: Artifact | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of the rows."""
        places = ("in simulation", "on the real side", "95 % interval", ends(self._unit))
        return ("iteration", "policy", *places, "gain", "real episodes")

    @property
    def rising(self) -> bool:
        """The paper's stop rule, with the interval: is v(pi_i) - v(pi_i-1) surely above 0?"""
        return bool(self._done[-1].metrics["gain"]["interval"][0] > 0.0)

    @property
    def last(self) -> str | None:
        """Where the policy is that the next iteration goes on from, none while π0 is the best."""
        return None if self.best is None else str(self.best.folder)

    def add_diagnosis(self, flight: Flight) -> None:
        """Take in the diagnosis on which the iterations stand; what it cost goes into the first one's row."""
        self._flight = flight
        self._spent += flight.episodes

    def add(self, evaluation: Artifact, collected: int) -> list[tuple[str, ...]]:
        """Take in an iteration that has collected some real episodes, and return its rows."""
        self._done.append(evaluation)
        cost = collected + evaluation.metrics["real_episodes"]
        self._spent += cost
        self._collected += collected
        first = len(self._done) == 1
        if self.rising or (first and evaluation.metrics["gain"]["value"] > 0.0):
            self.best = evaluation
        in_the_air = f" + {self._flight.episodes} in the air" if first and self._flight else ""
        over = f"π{len(self._done) - 1}"
        return self._add(str(len(self._done)), evaluation.metrics, f"{cost}{in_the_air}", over, first=first)

    def add_refusal(self, why: str, collected: int) -> tuple[str, ...]:
        """Take in an iteration that ended at its grounding, after some real episodes, and return its row."""
        self._spent += collected
        self._collected += collected
        number = len(self._done) + 1
        self._refusal = f"The grounding of iteration {number} was refused: {why}. "
        row = (str(number), "grounding refused", *[""] * (len(self.columns) - 3), str(collected))
        self.rows.append(row)
        return row

    def add_beside(self, evaluation: Artifact) -> list[tuple[str, ...]]:
        """Take in what is shown for comparison, and return its rows."""
        self._beside = evaluation
        return self._add(
            "no grounding", evaluation.metrics, str(evaluation.metrics["real_episodes"]), "π0", first=False
        )

    @property
    def verdict(self) -> str:
        """The result in a sentence or two, with what it cost, and beside the search without grounding."""
        return f"{self._figures}{self._without_gain}"

    @property
    def _figures(self) -> str:
        air = self._flight.episodes if self._flight else 0
        flown = f" and {air} motions in the air" if air else ""
        cost = f"{self._spent - air} real episodes{flown} were spent."
        if self.best is None:
            return f"No improvement over π0 was found: π0 is returned. {cost}"
        after, before = self.best.metrics["returned"], self._done[0].metrics["baseline"]
        unit = self._unit
        bounds, name = unit.interval(self.best.metrics["gain"]["interval"], sign=True), unit.name
        if before["interval"][0] > 0.0:
            low, high = (100.0 * bound / before["value"] for bound in self.best.metrics["gain"]["interval"])
            bounds, name = f"{low:+.0f} to {high:+.0f}", "% of π0"
        last = " ".join(filter(None, ["gain of the last step", bounds, name, "(95 %)"]))
        of = f" by iteration {1 + self._done.index(self.best)}" if len(self._done) > 1 else ""
        fell = f"{after['falls']} falls in " if unit.falls else ""
        end = f"{fell}{after['episodes']} fresh episodes. {self._end}{cost}"
        values = f"π0 {unit.bare(before['value'])}, returned{of} {unit.format(after['value'])}"
        return f"On the real side: {values}, {last}, {end}"

    @property
    def _end(self) -> str:
        """Why no iteration followed: the last one's gain is not sure, or the next one's grounding was refused."""
        unsure = f"The gain of iteration {len(self._done)} is not sure: no other follows. "
        return self._refusal if self.rising else unsure

    def metrics(self) -> Mapping[str, Any]:
        """Return the figures of all rounds."""
        best = self._done[0] if self.best is None else self.best
        gain = best.metrics["gain"]
        if self.best is None:
            gain = {"value": 0.0, "interval": [0.0, 0.0], "share": None if gain["share"] is None else 0.0}
        return {
            "iterations": len(self._done),
            "returned_iteration": 0 if self.best is None else 1 + self._done.index(self.best),
            "returned": best.metrics["baseline" if self.best is None else "returned"],
            "baseline": self._done[0].metrics["baseline"],
            "gain": gain,
            "real_episodes": self._spent,
            "learned_from": self._collected,
            **self._of_the_flight(),
            "stopped_by_itself": not self.rising or bool(self._refusal),
            "verdict": self.verdict,
            "broken_promises": self.broken_promises,
            "ungrounded": None if self._beside is None else self._beside.metrics,
        }

    @property
    def diagnosis(self) -> list[str]:
        """What was diagnosed and what was done with it, in a line; none if nothing was."""
        return list(self._flight.findings) if self._flight else []

    @property
    def broken_promises(self) -> list[str]:
        """What searches promised and the real world did not give, a line each."""
        promises = {k: evaluation.metrics.get("promise") for k, evaluation in enumerate(self._done, 1)}
        return [f"Iteration {k}: {kept['warning']}." for k, kept in promises.items() if kept and kept["warning"]]

    def _of_the_flight(self) -> Mapping[str, Any]:
        if self._flight is None:
            return {"excitation": None, "diagnosis": None, "servo": None}
        flight = self._flight
        causes, servo = flight.diagnosis, flight.servo
        diagnosis = gap = None
        if causes is not None:
            diagnosis = {"verdict": causes.verdict, "causes": list(causes.causes), "told": flight.verdict}
        if servo is not None:
            gap = {"floors_before": servo["floors_before"], "floors_after": servo["floors_after"], "told": flight.gap}
        excitation = {"episodes": flight.episodes, "real_seconds": flight.seconds}
        return {"excitation": excitation, "diagnosis": diagnosis, "servo": gap}

    def searches(self) -> list[Search]:
        """Return the panels of the learning curve."""
        panels = [self._search(f"iteration {k + 1}", evaluation, f"π{k}") for k, evaluation in enumerate(self._done)]
        if self._beside is not None:
            panels.append(self._search("without grounding", self._beside, "π0"))
        return panels

    @property
    def title(self) -> str:
        """What came out, in a line, with the figures of the table."""
        figures, unit = self.metrics(), self._unit
        before, after = unit.bare(figures["baseline"]["value"]), unit.format(figures["returned"]["value"])
        with_it = " with grounding" if self._beside else ""
        without = f", {unit.bare(self._beside.metrics['returned']['value'])} without" if self._beside else ""
        if self.best is None:
            return f"Real side: π0 is returned{with_it}, {after}{without}"
        doubt = "" if figures["gain"]["interval"][0] > 0.0 else "; the gain is not significant"
        return f"Real side: {after}{with_it}{without}, π0 {before}{doubt}"

    @property
    def answer(self) -> Answer:
        """The result as a page says it first: with its interval, and whether that leaves out 0."""
        figures, unit = self.metrics(), self._unit
        question = "Does grounded simulation learning find a better policy for the real side?"
        after, before, gain = figures["returned"], figures["baseline"], figures["gain"]
        if self.best is None:
            reached = f"{unit.format(after['value'])} (95 % {unit.interval(after['interval'])})"
            sentence = f"No policy better than π0 was found. π0 is returned; it reaches {reached} on the real side."
            return Answer(question, sentence, sure=False, more=[self._figures, *self._without])
        over = "π0" if figures["returned_iteration"] == 1 else "the iteration before"
        sentence, sure = describe_gain("The returned policy", after, before, gain, unit, over)
        ahead = self._beside is None or after["value"] > self._beside.metrics["returned"]["value"]
        return Answer(question, f"{sentence}{self._without_gain}", sure and ahead, [self._figures, *self._without])

    @property
    def _without_gain(self) -> str:
        """That the policy is not better than that of the search without grounding, or not surely, if that is so."""
        if self._beside is None or self.best is None:
            return ""
        with_it, without = self.best.metrics["returned"], self._beside.metrics["returned"]
        margins = [summary["value"] - summary["interval"][0] for summary in (with_it, without)]
        if with_it["value"] - without["value"] > math.hypot(*margins):  # both were measured independently
            return ""
        ahead = with_it["value"] > without["value"]
        says = "One run does not show that the policy is" if ahead else "The policy is not"
        return f" {says} better than that of the search without grounding, {self._unit.format(without['value'])}."

    @property
    def _without(self) -> list[str]:
        """What the same search returned without grounding, in a sentence; none if nobody asked."""
        if self._beside is None:
            return []
        returned, unit = self._beside.metrics["returned"], self._unit
        fell = f", {falls(returned['falls'])} in {returned['episodes']} fresh episodes" if unit.falls else ""
        reached = f"{unit.format(returned['value'])} (95 % {unit.interval(returned['interval'])})"
        return [f"Without grounding the same search returned a policy with {reached}{fell}."]

    @property
    def budget(self) -> list[tuple[str, str]]:
        """What real data were spent on."""
        figures, flight = self.metrics(), self._flight
        air = flight.episodes if flight else 0
        measured = self._spent - self._collected - air
        pairs = [("motions in the air", f"{air}, {flight.seconds:.0f} s" if flight else "")]
        pairs += [("episodes to learn from", str(self._collected or "")), ("episodes to measure", str(measured))]
        pairs += [("in all", str(figures["real_episodes"]))]
        beside = figures["ungrounded"]
        return [*pairs, ("for the search without grounding", str(beside["real_episodes"]) if beside else "")]

    @property
    def unit(self) -> str:
        """Of what people are shown."""
        return self._unit.name

    def _search(self, label: str, evaluation: Artifact, start: str) -> Search:
        document = json.loads((evaluation.folder / EVALUATION).read_text(encoding="utf-8"))
        return search(label, document, shown=self._unit.factor, returned=evaluation.metrics["best"], start=start)

    def _add(
        self, label: str, metrics: Mapping[str, Any], cost: str, over: str, *, first: bool
    ) -> list[tuple[str, ...]]:
        simulated, gain = metrics["returned_value_sim"], metrics["gain"]
        expected = "" if simulated is None else self._unit.bare(simulated)
        improvement = f"{format_gain(gain['share']) or self._unit.format(gain['value'], sign=True)} over {over}"
        zero: tuple[str, ...] = ("0", "π0", "", *self._format_measured(metrics["baseline"]), "", "")
        rows = [zero] if first else []
        name = name_policy(metrics["best"])
        rows.append((label, name, expected, *self._format_measured(metrics["returned"]), improvement, cost))
        self.rows += rows
        return rows

    def _format_measured(self, summary: Mapping[str, Any]) -> tuple[str, str, str]:
        return (
            self._unit.bare(summary["value"]),
            self._unit.interval(summary["interval"]),
            format_ends(summary, self._unit),
        )


def write_table(folder: Path, rounds: Rounds, remarks: Sequence[str] = ()) -> None:
    """Write the table, the diagnosis if there was one, the verdict, broken promises and further remarks as markdown."""
    below = [*rounds.diagnosis, rounds.verdict, *rounds.broken_promises, *remarks]
    text = "\n\n".join([table(rounds.columns, rounds.rows).rstrip(), *below])
    (folder / MARKDOWN).write_text(f"{text}\n", encoding="utf-8")


def write_curve(folder: Path, rounds: Rounds) -> None:
    """Write the learning curve of all iterations, and of the search without grounding if there was one."""
    learning_curve(folder / CURVE, rounds.searches(), unit=rounds.unit, title=rounds.title)
