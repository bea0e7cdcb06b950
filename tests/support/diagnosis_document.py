"""Documents of diagnoses as `gsl diagnose` writes them, made up for the tests of their report."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

NAO = tuple(
    f"{side}{joint}"
    for side in "LR"
    for joint in ("HipRoll", "HipPitch", "KneePitch", "AnklePitch", "AnkleRoll", "ShoulderPitch", "ShoulderRoll")
)
REGIMES = ("all", "rest", "slow", "fast", "reversal", "high_load", "saturated", "early", "late")
TIME = np.arange(0.0, 3.0, 0.02)


def where(joints: tuple[str, ...], worst: dict[str, float]) -> list[dict[str, Any]]:
    """Cells of a map; the shares of the worst joints are spread over regimes, the rest is noise."""
    rng, cells = np.random.default_rng(0), []
    spread = dict(zip(REGIMES, (1.0, 0.05, 0.2, 0.65, 0.3, 0.4, 0.0, 0.34, 0.36), strict=True))
    for joint in joints:
        for regime in REGIMES:
            share = worst.get(joint, 0.0) * spread[regime] + 0.004 * rng.standard_normal()
            named = joint in worst and spread[regime] > 0.1
            bounds = {"low": 0.85 * share - 0.01, "high": 1.15 * share + 0.01}
            rms = 1.0 + (7.0 * share if named else 0.05 * rng.random())
            cells.append({"joint": joint, "regime": regime, "share": share, **bounds, "rms": rms, "named": named})
    return cells


def horizon(joints: tuple[str, ...], worst: dict[str, float]) -> dict[str, Any]:
    """The gap of each joint by horizon."""
    time = np.arange(1, 26) * 0.02
    rms = {joint: (0.9 + 7.0 * worst.get(joint, 0.01) * (1 - np.exp(-time / 0.1))).tolist() for joint in joints}
    return {"time": time.tolist(), "rms": rms}


def replay(joint: str, record: str) -> dict[str, Any]:
    """Steps that the robot follows late and short of."""
    command = 0.3 * np.sign(np.sin(4.0 * TIME))
    real, before = np.zeros_like(TIME), np.zeros_like(TIME)
    for k in range(1, len(TIME)):
        real[k] = real[k - 1] + 0.12 * (0.9 * command[k - 1] - real[k - 1])
        before[k] = before[k - 1] + 0.25 * (command[k - 1] - before[k - 1])
    after = real + 0.004 * np.sin(9.0 * TIME)
    lines = {"command": command, "real": real, "before": before, "after": after}
    return {"record": record, "joint": joint, "time": TIME.tolist()} | {k: v.tolist() for k, v in lines.items()}


def ranked(effects: list[str], scopes: list[str], fitted: str, gain: float, level: float, p: float) -> dict[str, Any]:
    """One hypothesis."""
    bounds = {"value": gain, "low": gain - 0.06 - 0.1 * (1 - gain), "high": gain + 0.05}
    named = {"effects": effects, "scopes": scopes, "parameters": fitted}
    return {**named, "gain": bounds, "level": level, "probability": p}


def servo_gain(joint: str = "LKneePitch") -> dict[str, Any]:
    """A cause with two parameters."""
    return {
        "effect": "servo_gain",
        "joints": [joint],
        "scope": joint,
        "fixed": {},
        "parameters": {
            "kp": {"value": 0.57, "low": 0.55, "high": 0.6, "unit": ""},
            "kd": {"value": 0.81, "low": 0.7, "high": 0.92, "unit": ""},
        },
        "probability": 0.97,
        "gain": {"value": 0.81, "low": 0.7, "high": 0.9},
        "meaning": "Factors on the proportional and the derivative gain.",
    }


def zero_offset() -> dict[str, Any]:
    """A cause that is an angle, on a group of joints that has a name."""
    return {
        "effect": "zero_offset",
        "joints": list(NAO[:10]),
        "scope": "legs",
        "fixed": {},
        "parameters": {"offset": {"value": 0.0175, "low": 0.0157, "high": 0.0192, "unit": "rad"}},
        "probability": 0.6,
        "gain": {"value": 0.9, "low": 0.8, "high": 0.95},
        "meaning": "A joint that was calibrated wrongly, in the servo: it stands elsewhere than it was told.",
    }


def latency() -> dict[str, Any]:
    """A cause with one parameter."""
    return {
        "effect": "command_latency",
        "joints": list(NAO),
        "scope": "all",
        "fixed": {},
        "parameters": {"delay": {"value": 0.0312, "low": 0.029, "high": 0.0335, "unit": "s"}},
        "probability": 0.999,
        "gain": {"value": 0.14, "low": 0.1, "high": 0.19},
        "meaning": "The target arrives later.",
    }


def _shrinkage(joints: tuple[str, ...], worst: dict[str, float]) -> dict[str, Any]:
    parts = [{"joint": joint, "before": 1.0 + 7 * worst.get(joint, 0.01), "after": 1.04} for joint in joints]
    kinds = [{"regime": kind, "before": 1.5 + 0.4 * index, "after": 1.05} for index, kind in enumerate(REGIMES[1:6])]
    whole = {"floor": 1.0, "before": 3.2, "after": 1.05, "fraction": 0.977, "low": 0.95, "high": 0.99}
    return {**whole, "ceiling_fraction": 0.984, "calibration": 2.4, "by_joint": parts, "by_regime": kinds}


def policy_gap() -> dict[str, Any]:
    """Policies that the simulator flatters, one that falls in real only; the diagnosed one knows them better."""
    returns = {"pi0": (0.25, 0.235, 0.23, 0), "generation_04": (0.297, 0.271, 0.267, 0), "generation_05": (
        0.31, 0.21, 0.16, 1)}  # fmt: skip
    rows = [
        {
            "name": name,
            "sim": {"value": sim, "low": sim - 0.01, "high": sim + 0.01, "falls": 0, "episodes": 5},
            "diagnosed": {
                "value": diagnosed,
                "low": diagnosed - 0.02,
                "high": diagnosed + 0.02,
                "falls": falls,
                "episodes": 5,
            },
            "real": {"value": real, "low": None if falls else 0.2, "high": 0.28, "falls": falls, "episodes": 5},
        }
        for name, (sim, diagnosed, real, falls) in returns.items()
    ]
    return {
        "unit": "cm/s",
        "shown": 100.0,
        "policies": 3,
        "measured": 25,
        "episodes": 5,
        "simulator": "diagnosed",
        "rows": rows,
        "gap": {
            "before": {"value": 0.067, "low": 0.02, "high": 0.15},
            "after": {"value": 0.02, "low": 0.004, "high": 0.05},
        },
        "correlation": {
            "before": {"value": -0.5, "low": -1.0, "high": 1.0},
            "after": {"value": 1.0, "low": 1.0, "high": 1.0},
        },
        "caveats": ["25 policies were measured; these 3 are spread over the list."],
    }


def document(joints: tuple[str, ...] = NAO, *, causes: int = 2) -> dict[str, Any]:
    """A diagnosis with everything in it.

    Args:
        joints: Of the robot.
        causes: How many were found, 1 or 2.
    """
    knee = joints[min(2, len(joints) - 1)]
    worst = dict(zip((knee, *[joint for joint in joints if joint != knee][:2]), (0.6, 0.22, 0.08), strict=False))
    return {
        "verdict": "causes",
        "summary": f"{knee} is soft: its servo pulls with 57 % of the gain that the simulator has.",
        "causes": [servo_gain(knee), latency()][:causes],
        "inseparable": [],
        "where": where(joints, worst),
        "horizon": horizon(joints, worst),
        "sides": [
            {"pair": "KneePitch", "left": 4.0, "right": 1.1, "p": 0.01},
            {"pair": "HipPitch", "left": 1.2, "right": 1.1, "p": 0.4},
        ],
        "shrinkage": _shrinkage(joints, worst),
        "ranking": [
            ranked(["servo_gain", "command_latency"], [knee, "all"], "kp 0.57, kd 0.81, delay 0.031", 0.95, 1.02, 0.97),
            ranked(["servo_gain"], [knee], "kp 0.52", 0.81, 1.42, 0.02),
            ranked(["viscous_friction"], [knee], "coefficient 0.9", 0.44, 2.2, 0.005),
            ranked(["command_latency"], ["all"], "delay 0.033", 0.14, 2.9, 0.001),
            ranked([], [], "", 0.02, 3.1, 0.0),
            ranked(["gain_fade"], ["legs"], "rate 0.004", -0.03, 3.3, 0.0),
        ],
        "calibration": [
            {"joint": joint, "kp": 1.02, "kd": 0.97, "coulomb": 0.0102, "viscous": 0.004, "zero": -0.002}
            for joint in joints
        ],
        "floor": {"source": "repeats", "pairs": 2, "sd": {joint: 0.0015 for joint in joints}},
        "invisible": ["ground_friction", "ground_compliance", "uneven_ground"],
        "caveats": ["The joints were moved in the air: nothing can be said of feet and ground."],
        "next_experiment": {
            "excitation": "steps_large",
            "separates": [["kp", "mass"]],
            "file": "runs/worn/diagnose/next.json",
            "why": "A heavier link answers a large step later, a softer servo less.",
        },
        "policy_gap": policy_gap(),
        "world_file": "runs/worn/diagnose/world/diagnosed.yaml",
        "report": "runs/worn/diagnose/report.html",
        "data": {
            "robot": "nao",
            "sim": "nao_ideal",
            "records": 20,
            "seconds": 70.0,
            "train": 10,
            "held_out": 10,
            "windows": 198,
            "source": "runs/worn/collect_real",
            "reference": None,
            "engine": "chain",
        },
        "replays": [replay(joint, "steps_large_b") for joint in list(worst)[:3]],
        "self_test": {
            "cases": 12,
            "null_gain": 14.0,
            "confusions": [
                {"truth": "servo_gain", "answer": "servo_gain", "count": 4},
                {"truth": "command_latency", "answer": "command_latency", "count": 4},
                {"truth": "command_latency", "answer": "sensor_delay", "count": 1},
            ],
        },
        "verified": {"windows": 12, "chain_rms_mrad": 0.31, "rms": 1.07},
        "command": "gsl diagnose real=runs/worn/collect_real sim=nao_ideal",
    }


def no_gap() -> dict[str, Any]:
    """A diagnosis of a robot that is as its simulator."""
    report = document()
    whole = {"floor": 1.0, "before": 1.02, "after": None, "fraction": None, "low": None, "high": None}
    return report | {
        "verdict": "no_gap",
        "summary": "The simulator is within the noise of the robot in every joint.",
        "causes": [],
        "where": where(NAO, {}),
        "horizon": horizon(NAO, {}),
        "sides": [],
        "shrinkage": {**whole, "ceiling_fraction": None, "calibration": 1.01, "by_joint": [], "by_regime": []},
        "ranking": [ranked(["armature"], ["legs"], "inertia 0.0002", 0.004, 1.01, 0.3)],
        "next_experiment": None,
        "replays": [],
        "policy_gap": None,
        "world_file": None,
    }


def inseparable() -> dict[str, Any]:
    """A diagnosis that ends with two explanations."""
    report = document(causes=1)
    summary = "A zero offset and a sensor's bias look alike in the air; the robot's stance would tell them apart."
    return report | {
        "verdict": "inseparable",
        "summary": summary,
        "causes": [zero_offset()],
        "inseparable": [["zero_offset", "sensor_bias"]],
    }


def forms() -> list[dict[str, Any]]:
    """What is missing of two joints: a lag of one, a function of position of the other."""
    shares = {"gain": 0.0, "inertia": 0.2, "lag": 0.97, "speed": 0.0, "load": 0.9, "position": 0.1, "time": 0.0}
    knee = {"joint": "LKneePitch", "form": "lag", "shares": shares, "late": 0.0203, "x": [], "y": []}
    other = {**shares, "lag": 0.1, "load": 0.2, "position": 0.99}
    curve = {"x": [-0.4, 0.0, 0.4], "y": [0.2, 0.0, -0.2]}
    return [knee, {"joint": "LHipPitch", "form": "position", "shares": other, "late": -0.001, **curve}]


def unknown() -> dict[str, Any]:
    """A diagnosis that finds a gap and no cause."""
    report = document()
    shrinkage = report["shrinkage"] | {"after": 2.1, "fraction": 0.5, "low": 0.42, "high": 0.57}
    ranking = copy.deepcopy(report["ranking"])[1:]
    summary = "The gap is far above the noise, and the best effect explains half of what a servo could explain."
    return report | {
        "verdict": "unknown",
        "summary": summary,
        "causes": [],
        "suspects": [servo_gain()],
        "ranking": ranking,
        "shrinkage": shrinkage,
        "next_experiment": None,
        "forms": forms(),
    }
