"""The pages of a search, of a learned servo and of what was collected have the figures of their results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from browser import check_seen
from page_reader import words

from gsl.core.trajectory import Batch, Trajectory
from gsl.core.unit import Unit
from gsl.models.servo import neutral
from gsl.report.collection_page import write_collection_page
from gsl.report.footfalls import Walk
from gsl.report.run_page import Change
from gsl.report.search_page import Winner, write_search_page
from gsl.report.servo_page import write_servo_page
from gsl.storage.generation_log import Generation
from gsl.storage.policies import PolicyRecord
from gsl.worlds.bullet import BulletWorld

UNIT = Unit(100.0, "cm/s")
CHANGE = Change(("step", "swing"), (0.2, 1.0), (0.25, 0.9), (0.1, 0.5))
TIME = np.arange(0.0, 1.01, 0.02)


def winner(number: int, values: list[float], falls: list[int]) -> Winner:
    record = PolicyRecord(f"generation_{number:02d}", {}, generation=number, value_sim=max(values))
    return Winner(record, Generation(number - 1, values, falls))


def seen(folder: Path) -> str:
    return words((folder / "report.html").read_text("utf-8")).replace("\xa0", " ")


def test_a_search_says_what_its_best_reaches_and_which_winners_were_not_kept(tmp_path: Path) -> None:
    winners = [winner(1, [0.1, 0.2], [1, 0]), winner(2, [0.3, 0.26], [0, 2])]
    screened = {
        "generation_01": {"falls": 0, "episodes": 20},
        "generation_02": {"falls": 1, "episodes": 4},
    }
    metrics = {"screened": screened, "drift": {"pi0": 0.125, "generation_01": 0.5}}
    check = {"pi0": {"value": 0.15}, "problems": []}
    write_search_page(
        tmp_path, winners, ["pi0", "generation_01"], winners[0].policy, metrics, CHANGE, UNIT,
        check=check, spent=[("episodes in simulation", "8")],
    )  # fmt: skip
    said = seen(tmp_path)
    assert "generation_01, the best of 2 generations, reaches 20.0 cm/s in simulation, π0 15.0." in said
    assert "generation_01 spends 50 % of its time where the grounding has seen nothing, π0 12 %." in said
    assert "generation_01 20.0 15.0 0 1 no falls in 20 generation_02 30.0 28.0 0 2 1 fall in 4, not kept" in said
    assert "step 0.2 0.25 +0.50" in said and "episodes in simulation 8" in said
    check_seen(tmp_path / "report.html", "reaches 20.0 cm/s", "1 fall in 4, not kept", "value [cm/s]")


def test_a_search_in_a_task_without_falls_names_none_and_a_failed_check_is_said(tmp_path: Path) -> None:
    metrics = {"best_cvar_sim": 3.0}
    alone = winner(1, [3.0], [0])
    write_search_page(
        tmp_path, [alone], ["start", "generation_01"], alone.policy, metrics, CHANGE, Unit(falls=False),
        check={"pi0": {"value": 1.0}, "problems": ["π0 falls"]}, spent=[],
    )  # fmt: skip
    said = seen(tmp_path)
    write_search_page(
        tmp_path, [alone], ["start"], alone.policy, metrics, CHANGE, UNIT, check={"pi0": {"real": {}}}, spent=[]
    )
    assert "reaches 300.0 cm/s in simulation." in seen(tmp_path)  # a check of states knows no value of π0
    assert "reaches 3.0 in simulation, where it began 1.0." in said and "The check says: π0 falls." in said
    assert "generation in simulation mean of its worst episodes generation_01 3.0 3.0" in said


def test_what_was_collected_is_told_episode_by_episode(tmp_path: Path) -> None:
    def episode(value: float, fell: bool) -> Trajectory:
        position = np.column_stack([np.sin(TIME), 0.01 * TIME])
        reward = np.full(len(TIME) - 1, value / (len(TIME) - 1))
        end = fell & np.equal(TIME, TIME[-1])
        return Trajectory(TIME, position[:-1], position, position, reward=reward, fell=end)

    names = ("pi0", "pi0", "neighbour_01")
    about = {"role": "real", "episodes": [{"policy": name} for name in names]}
    episodes = (episode(0.2, False), episode(0.22, False), episode(0.05, True))
    batch = Batch(episodes, ("knee", "rail"), 0.02, about)
    walk = Walk("the first episode", TIME, {"left": TIME < 0.5, "right": TIME >= 0.5})
    write_collection_page(tmp_path, batch, 2, UNIT, noisy=True, walk=walk, slides=("rail",))
    said = seen(tmp_path)
    assert "3 episodes of 3 s in all were recorded on the real side, with 1 fall." in said
    assert "π0 with noise reaches 21.0 cm/s (95 % 8.3 to 33.7) in 2 episodes." in said  # ± 12.7 · 0.1 · √2 / √2 · 10
    assert "π0 1.00 20.0 stood π0 1.00 22.0 stood neighbour_01 1.00 5.0 fell" in said
    assert "knee [°]" in said and "rail [mm]" in said and "episodes 3 time 3 s steps 150" in said
    check_seen(tmp_path / "report.html", "with 1 fall", "knee [°]", "left")


def test_simulated_trajectories_of_an_environment_cost_nothing_real(tmp_path: Path) -> None:
    nothing = np.zeros((len(TIME), 0))
    state = np.column_stack([TIME, np.cos(TIME)])
    batch = Batch(
        (Trajectory(TIME, TIME[:-1, None], nothing, nothing, state=state),), ("0",), 0.02,
        {"role": "sim", "episodes": [{"policy": "steps"}]},
    )  # fmt: skip
    write_collection_page(tmp_path, batch, 0, Unit(falls=False), noisy=False, walk=None, slides=())
    said = seen(tmp_path)
    assert "1 episode of 50 steps in all was recorded in simulation." in said and "State over time" in said
    assert "state.1" in said and "Joint" not in said
    assert "policy time [s] steps 1.00" in said and "real episodes none" in said


def test_a_learned_servo_says_its_gap_its_numbers_and_why_not_to_use_it(tmp_path: Path) -> None:
    plant = BulletWorld("nao", {}).plant
    model = neutral(plant, np.random.default_rng(0))
    each = np.ones(len(model.joints))
    numbers = {**model.numbers, "kp": np.log(0.6) * each, "delay": 0.02 * each, "offset": np.radians(-0.5) * each}
    groups = {name: {"floors_before": 9.0, "floors_after": 4.0, "learned": True} for name in model.groups}
    metrics = {
        "floors_before": 9.0, "floors_after": 4.0, "learned": True, "groups": groups, "step": 0.002,
        "problems": ["it is too far"], "walks": {"floors_before": 7.0, "floors_after": 3.0},
    }  # fmt: skip
    write_servo_page(
        tmp_path, metrics, replace(model, numbers=numbers), plant, 0.02, [float("nan"), 5.0, 4.5],
        spent=[("motions in the air", "5, 8 s")],
    )  # fmt: skip
    said = seen(tmp_path)
    assert "? On held-out motions the learned servo takes the gap from 9.0 to 4.00 noise floors." in said
    assert "On held-out walks it goes from 7.0 to 3.00." in said and "It is too far." in said
    assert "joint kp delay [ms] offset [°]" in said and "LKneePitch × 0.60 +20 −0.5" in said
    assert "distance [noise floors]" in said and "motions in the air 5, 8 s" in said
    check_seen(tmp_path / "report.html", "from 9.0 to 4.00", "time after a step [s]", "× 0.60")
