"""The gate before a search: a grounding that makes the simulator no better is refused, with the report that says so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.seeds import derived_seed
from gsl.errors import GslError, InputError, TrajectoryError
from gsl.grounding.gat import ActionTransformation
from gsl.report.grounding_errors import grounding_errors
from gsl.stages.grounding_check import TITLES, check, largest_stable_alpha
from gsl.stages.rollout import Scenario
from gsl.stages.train_forward import HELDOUT
from gsl.storage.documents import write_json
from gsl.storage.models import model_file, read_forward_model, read_inverse_model
from gsl.storage.references import resolve
from gsl.storage.trajectories import read

REPORT, FIGURE = "grounding.json", "grounding.png"


def grounding_parents(grounding: Any) -> Mapping[str, Path]:
    """Return the models a grounding is made of, by role."""
    if not isinstance(grounding, ActionTransformation):
        return {}
    return {
        "grounding.forward_model": resolve(grounding.forward_model, kind="train_forward"),
        "grounding.inverse_model": resolve(grounding.inverse_model, kind="train_inverse"),
    }


def grounded(
    scenario: Scenario, parameters: np.ndarray, folder: Path, console: Any, *, accept: bool, seed: int
) -> tuple[Scenario, Mapping[str, Any]]:
    """Load a grounding's models, settle alpha, write its report, and let it through or not.

    Returns:
        The scenario with the grounding ready to act, and what to report of it.

    Raises:
        GslError: The grounding fails its check and `accept` is not set.
    """
    settings = scenario.grounding
    if not isinstance(settings, ActionTransformation):
        return scenario, {}
    console.status("checking the grounded simulator against held-out real trajectories")
    loaded = settings.load(read_forward_model, read_inverse_model)
    ready = replace(scenario, grounding=loaded)
    if settings.alpha == "auto":
        alpha = largest_stable_alpha(ready, parameters, derived_seed(seed, "alpha"))
        ready = replace(scenario, grounding=replace(loaded, alpha=alpha))
    heldout = model_file(settings.forward_model, "forward_model").with_name(HELDOUT)
    try:
        report = check(ready, parameters, read(heldout), derived_seed(seed, "check"))
    except InputError as error:
        raise error if isinstance(error, TrajectoryError) else TrajectoryError(heldout, str(error)) from error
    write_json(folder / REPORT, report.metrics())
    grounding_errors(folder / FIGURE, report.by_joint())
    console.table("grounded simulator against held-out real trajectories", TITLES, report.rows())
    if not report.acceptable:
        problem = "; ".join(report.problems)
        if not accept:
            raise GslError(f"this grounding is refused: {problem}. Collect more data, or go on with accept=true")
        console.status(f"warning: {problem}")
    return ready, {"alpha": report.alpha, "grounding_acceptable": report.acceptable}
