"""The headline of an artifact: what came out of a stage, in a few words with units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from gsl.core.unit import Unit, format_gain
from gsl.core.words import falls, in_unit, name_effects, several
from gsl.errors import ArtifactError
from gsl.storage.artifact import Artifact

Metrics = Mapping[str, Any]
VALUED = ("value", "value_sim", "interval", "returned_value_sim", "best_value_sim", "best_cvar_sim")
"""Last part of the names of metrics that are values of a task."""
PROMISED = ("promise", "upper")


def unit_of(artifact: Artifact) -> Unit:
    """Return the unit of an artifact's task; the bare value where there is none."""
    return Unit(**artifact.manifest.unit) if artifact.manifest.unit else Unit()


def show_in_unit(metrics: Metrics, unit: Unit) -> dict[str, Any]:
    """Return metrics by dotted name as people are shown them: values of the task in its unit, which their names say."""
    return {title_in_unit(name, unit): _scale(value, _factor(name, unit)) for name, value in metrics.items()}


def title_in_unit(name: str, unit: Unit) -> str:
    """Return the dotted name of a metric, with the unit of the task if it is a value of it."""
    return in_unit(name, unit.name) if _is_value(name) else name


def _factor(name: str, unit: Unit) -> float:
    return unit.factor if _is_value(name) else 1.0


def _is_value(name: str) -> bool:
    parts = [part for part in name.split(".") if not part.isdecimal()]
    return parts[-1] in VALUED or tuple(parts[-2:]) == PROMISED


def _scale(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_scale(entry, factor) for entry in value]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return factor * value if number and factor != 1.0 else value


def headline(artifact: Artifact) -> str:
    """Return what came out; a stage of another package says it in its metrics, one of another version nothing."""
    tell = _TELLERS.get(artifact.manifest.kind)
    try:
        return tell(artifact.metrics, unit_of(artifact)) if tell else str(artifact.metrics.get("headline", ""))
    except (ArtifactError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, StopIteration):
        return ""


def _collect(metrics: Metrics, unit: Unit) -> str:
    line = several(metrics["episodes"], "episode") + (f", {falls(metrics['falls'])}" if unit.falls else "")
    if metrics["value"] is None:
        return line
    return f"{line}, π0 {'with noise ' * bool(metrics.get('action_noise'))}{unit.format(metrics['value'])}"


def _import(metrics: Metrics, unit: Unit) -> str:
    return f"{several(metrics['episodes'], 'episode')}, {metrics['seconds']:.0f} s, {metrics['time']}"


def _diagnose(metrics: Metrics, unit: Unit) -> str:
    causes, verdict = ", ".join(metrics["causes"]), metrics["verdict"].replace("_", " ")
    share = metrics["fraction"]
    gone = "" if share is None else f"; {100 * share:.0f} % of the held-out gap is gone"
    return f"{verdict}: {causes}{gone}" if causes else f"{verdict}{gone}"


def _identify(metrics: Metrics, unit: Unit) -> str:
    return f"{metrics['effects']} effects; {metrics['before']:.1f} noise floors became {metrics['after']:.1f}"


def _train_forward(metrics: Metrics, unit: Unit) -> str:
    if metrics.get("space"):
        return _of_states(metrics)
    names = {"pi0": "of π0", "off_pi0": "off π0"}
    errors = {
        names[group]: measured.get("free_run_deg", measured["one_step_deg"])
        for group, measured in metrics["heldout"].items()
    }
    return f"{metrics['family']}, held out: " + ", ".join(f"{error:.2f}° {group}" for group, error in errors.items())


def _of_states(metrics: Metrics) -> str:
    if metrics["space"] == "counts":
        return f"{metrics['steps']:,} steps counted, {100 * metrics['visited']:.0f} % of all states and actions visited"
    heldout = metrics["heldout"]
    shown = {"r2": "of the variance", "action_r2": "of the variance", "recovered_choices": "of the choices"}
    score = next(f"{100 * heldout[name]:.1f} % {what}" for name, what in shown.items() if name in heldout)
    return f"{metrics['family']}, held out: {score}"


def _train_servo(metrics: Metrics, unit: Unit) -> str:
    return f"held out, {metrics['floors_before']:.1f} noise floors became {metrics['floors_after']:.2f}"


def _train_grounding(metrics: Metrics, unit: Unit) -> str:
    sizes = [f"{name} ({' x '.join(map(str, shape)) or 1} numbers)" for name, shape in metrics["arrays"].items()]
    return f"learned {', '.join(sizes)} from {several(metrics['trajectories'], 'real episode')}"


def _train_inverse(metrics: Metrics, unit: Unit) -> str:
    if metrics.get("space"):
        return _of_states(metrics)
    return f"{metrics['family']}, held out: {metrics['heldout']['recovered_action_deg']:.2f}° of action"


def _optimize(metrics: Metrics, unit: Unit) -> str:
    best = unit.format(metrics["best_value_sim"])
    line = f"{several(metrics['generations'], 'generation')}, best {best} in simulation"
    if "effects" in metrics:
        line += f"; {name_effects(metrics['effects'])} switched on" if metrics["effects"] else "; joints calibrated"
    alpha, passed = metrics.get("alpha"), metrics.get("grounding_acceptable", True)
    if alpha is None and passed:
        return line
    far = "" if alpha is None else f" (alpha {alpha:g})"
    verdict = "passed" if metrics.get("grounding_compared", True) else "passed, by the falls of π0 alone"
    return f"{line}; grounding{far} {verdict if passed else 'failed its check'}"


def _evaluate(metrics: Metrics, unit: Unit) -> str:
    after, gain = metrics["returned"], metrics["gain"]
    line = f"{metrics['best']} {unit.format(after['value'])}, {unit.describe_ends(after)}"
    share = format_gain(gain["share"]) if gain["share"] else ""
    return f"{line}; {share} over the start" if share else line


def _iterate(metrics: Metrics, unit: Unit) -> str:
    before, after = metrics["baseline"], metrics["returned"]
    line = f"π0 {unit.format(before['value'])} -> {unit.format(after['value'])}"
    return f"{line}, {unit.describe_ends(after)}; {metrics['real_episodes']} real episodes"


def _values(metrics: Metrics, unit: Unit) -> str:
    return f"{metrics['policies']} policies, {falls(metrics['falls'])}"


def _survey(metrics: Metrics, unit: Unit) -> str:
    return ", ".join(
        f"{name}: π0 {unit.format(figures['pi0'])}, rank {figures['rank']:.2f}" for name, figures in metrics.items()
    )


def _answer(metrics: Metrics, unit: Unit) -> str:
    return f"{metrics['episodes']} of {metrics['asked']} episodes, {falls(metrics['falls'])}"


_TELLERS: Mapping[str, Callable[[Metrics, Unit], str]] = {
    "collect": _collect,
    "import": _import,
    "diagnose": _diagnose,
    "identify": _identify,
    "train_forward": _train_forward,
    "train_grounding": _train_grounding,
    "train_inverse": _train_inverse,
    "train_servo": _train_servo,
    "optimize": _optimize,
    "evaluate": _evaluate,
    "iterate": _iterate,
    "survey": _survey,
    "values": _values,
    "answer": _answer,
    "rehearse": _answer,
}
