"""How joints move beside how they yield: rows of before, the table's cells, and what goes with gains."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from commands import gsl
from scipy.stats import spearmanr

from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.hydra_door import open_hydra
from gsl.errors import ArtifactError
from gsl.report.style import GAT, UNINFORMED
from gsl.validation.compliance import Compliance
from gsl.validation.compliance_transfer import compute_transfers
from gsl_experiments.gain_predictors import points, predictors, rank_correlations, read_searches
from gsl_experiments.ledger_file import read
from gsl_experiments.replay import Replay
from gsl_experiments.replays_table import Shown
from gsl_experiments.yielding import compute_closed_strength

pytestmark = pytest.mark.slow

COMMITTED = Path(__file__).parents[2] / "experiments/trials"
STIFF = "stiffness, legs (joint by joint)"
SHARES = ("stiffness", "strength", "stiffness_closed", "strength_closed")
COLOURS = {"none": UNINFORMED, "gat": GAT}


def row(method: str, joints: float, stiff: float | None, strong: float | None = None, trial: int = 1) -> Replay:
    """With half of what is handed over closed joint by joint."""
    closed = (None if share is None else 0.5 * share for share in (stiff, strong))
    shares = ({"legs": share, "arms": None} for share in (stiff, strong, *closed))
    return Replay("nao_worn", method, trial, 0.1, joints, 1.0, 1.0, None, None, 60, *shares)


def before(method: str, joints: float, trial: int = 1) -> Replay:
    return row(method, joints, None, None, trial)._replace(**dict.fromkeys(SHARES))


def cells(rows: list[Replay]) -> dict[str, dict[str, str]]:
    """A table's cells by method and title."""
    shown = Shown(rows, ("nao_worn",), COLOURS, ("legs", "arms"))
    titles, _, *lines = ([cell.strip() for cell in line[1:-1].split("|")] for line in shown.table().splitlines())
    return {line[1]: dict(zip(titles, line, strict=True)) for line in lines}


def test_trials_of_before_are_read_and_have_no_shares() -> None:
    batch = read(COMMITTED / "replays/replays.json", Replay)
    rows = [
        Replay(**{name: trial[name] for name in Replay._fields if name in trial})
        for own in batch.values()
        for trial in own
    ]
    assert len(rows) == 180 and not any(row.stiffness or row.strength or row.nearness("legs") for row in rows)
    assert set(cells([before("none", 2.0), before("gat", 1.0)])["gat"]) == {
        *("real world", "grounding", "joints after 0.2 s [°]", "95 % interval", "minus none (95 %, paired)"),
        *("after a tick [°]", "pitch [°]", "forward [mm]", "out of reach [%]"),
    }


@pytest.mark.parametrize(
    ("stiffness", "strength"), [({"legs": 1.0}, None), ({"legs": 1.0}, {"arms": 1.0}), ({"legs": "soft"}, {"legs": 1})]
)
def test_shares_of_half_a_measurement_are_refused(stiffness: object, strength: object, tmp_path: Path) -> None:
    document = row("gat", 1.0, 0.1)._asdict() | {"stiffness": stiffness, "strength": strength}
    (tmp_path / "replays.json").write_text(json.dumps([{**document, "recipe": "a", "made_by": "b"}]))
    with pytest.raises(ArtifactError, match="row 1"):
        read(tmp_path / "replays.json", Replay)


@pytest.mark.parametrize(
    ("stiff", "strong", "nearness"),
    [(0.0, 0.0, 0.0), (2.0, 2.0, 1.0), (None, 0.4, 0.2), (1.4, None, 0.7), (0.4, -1.2, -0.2), (None, None, None)],
)
def test_what_is_near_closes_the_gap_joint_by_joint(
    stiff: float | None, strong: float | None, nearness: float | None
) -> None:
    assert row("gat", 1.0, stiff, strong).nearness("legs") == (None if nearness is None else pytest.approx(nearness))


def test_joints_that_go_too_far_do_not_make_up_for_others() -> None:
    legs = {"legs": ("a", "b")}
    sim, grounded, real = (
        Compliance(("a", "b"), legs, ones, ones, 0.0 * ones, strength)
        for ones, strength in ((np.ones(2), np.array(torque)) for torque in ((3.0, 3.0), (3.0, 1.0), (2.0, 2.0)))
    )
    assert compute_transfers(sim, grounded, real)["legs"].torque == pytest.approx(1.0)
    assert compute_closed_strength(sim, grounded, real, "legs") == pytest.approx(0.0)
    assert compute_closed_strength(sim, real, real, "legs") == pytest.approx(1.0)
    assert compute_closed_strength(sim, grounded, sim, "legs") is None


def test_a_table_says_where_there_is_no_gap_and_where_nobody_measured() -> None:
    rows = [row("none", 2.0, 0.0), row("none", 2.0, 0.0, trial=2), row("gat", 1.0, 0.26), row("gat", 1.0, 0.6, trial=2)]
    every = cells(rows)
    assert every["none"][STIFF] == "0.00 (0.00)"
    assert every["gat"][STIFF] == "0.43 (0.21)"
    assert (
        every["gat"]["strength, legs (joint by joint)"] == every["gat"]["stiffness, arms (joint by joint)"] == "no gap"
    )
    some = cells([*rows[:2], rows[2], before("gat", 1.0, trial=2)])
    assert some["gat"][STIFF] == "0.26 (0.13) (1 of 2 trials)"
    none = cells([*rows[:2], before("gat", 1.0), before("gat", 1.0, trial=2)])
    assert none["gat"][STIFF] == none["gat"]["strength, arms (joint by joint)"] == "-"


def test_a_figure_has_panels_of_what_was_measured(tmp_path: Path) -> None:
    measured, old = [row("none", 2.0, 0.0), row("gat", 1.0, 0.3)], [before("none", 2.0), before("gat", 1.0)]
    for name, rows in {"both": measured, "old": old}.items():
        Shown(rows, ("nao_worn",), COLOURS, ("legs", "arms")).draw(tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 8_000
    assert (tmp_path / "both.png").read_bytes() != (tmp_path / "old.png").read_bytes()


def test_rank_correlations_are_those_of_all_permutations() -> None:
    rng = np.random.default_rng(3)
    first = {"a": [0.1, 0.5, 0.3, 0.9], "b": [3.0, 1.0, 2.0]}
    second = {"a": [1.0, 2.0, 2.0, 7.0], "b": [0.2, 0.3, 0.1]}
    rho, p = rank_correlations(first, second, rng)
    assert rho == pytest.approx({name: spearmanr(first[name], second[name]).statistic for name in first})
    observed = abs(np.mean(list(rho.values())))
    means = [
        abs(np.mean([spearmanr(first["a"], permuted).statistic, spearmanr(first["b"], other).statistic]))
        for permuted, other in itertools.product(
            itertools.permutations(second["a"]), itertools.permutations(second["b"])
        )
    ]
    assert p == pytest.approx(np.mean(np.array(means) >= observed - 1e-9), abs=0.015)


def test_what_does_not_vary_predicts_nothing() -> None:
    rho, p = rank_correlations({"a": [1.0, 1.0, 1.0]}, {"a": [1.0, 2.0, 3.0]}, np.random.default_rng(1))
    assert np.isnan(rho["a"]) and np.isnan(p)


def test_gains_are_set_against_how_joints_move_and_yield() -> None:
    """Table 2's mean gains in nao_worn; the order of replay errors is made up, that of shares is that of the gains."""
    trials = read_searches([COMMITTED / "table2/trials.json"])
    names = ("none", "gat", "gat_residual", "effects")
    of = {name: [trial for trial in trials if (trial.world, trial.method) == ("nao_worn", name)] for name in names}
    gains = {
        name: np.mean([trial.improvement for trial in own if trial.improvement is not None]) for name, own in of.items()
    }
    order = sorted(names, key=lambda name: gains[name])
    rows = [row(name, (1.0, 2.0, 4.0, 3.0)[rank], 0.25 * rank) for rank, name in enumerate(order)]
    own = points(rows, trials)["nao_worn"]
    assert {point.method: point.gain for point in own} == pytest.approx(gains)
    assert own[0].stable == sum(trial.stable for trial in of[order[0]]) / sum(trial.winners for trial in of[order[0]])
    section = predictors(rows, trials, 1)
    assert "| gain | small replay error | -0.80 | -0.80 |" in section
    assert "| gain | compliance transferred, legs | +1.00 | +1.00 |" in section and "4 points" in section
    assert predictors(rows[:2], trials, 1) == predictors([before("none", 1.0)], trials, 1) == ""


def test_learned_servos_are_methods_unless_they_draw(tmp_path: Path) -> None:
    with open_hydra(None):
        study = prepare(resolve(compose("reproduce_replays", ["trials=1"])))[0]
    study.check()
    assert {"servo", "effects_servo"} <= {method for _, _, method in study.recipes}
    for more, line in (
        ("methods.servo.noise=0.01", "methods.servo: is drawn anew each time"),
        ("methods.effects_servo.inner.torque_noise=1", "methods.effects_servo: is drawn anew each time"),
        ("gains=[]", "gains: is an empty list"),
    ):
        said = gsl("reproduce", "replays", more, "preset=toy", folder=tmp_path)
        assert said.code == 2 and line in said.lines[-1]
