"""Audit the wiring of a policy that gsl did not make: what its network sees and does, and what looks wrong."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

import gymnasium
import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import Policy, World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.words import several
from gsl.errors import ConfigError, GslError
from gsl.policies.outside import Outside
from gsl.policies.signals import UNITS
from gsl.policies.wired import Eyes, Hands, check_outputs
from gsl.policies.wiring import Wiring, factors
from gsl.policies.wiring_audit import Finding, audit

LARGE = 10.0  # that a network sees: trainers scale observations to about 1


@component
class WiringAudit:
    """Writes nothing; exits with 2 where the policy could not act."""

    kind: ClassVar[str] = "wiring"
    only_looks: ClassVar[bool] = True

    world: Annotated[World, setting("where it is to act")]
    policy: Annotated[Policy, setting("with a wiring")]

    def __post_init__(self) -> None:
        """Refuse a policy of gsl's own, which has no wiring."""
        if not isinstance(self.policy, Outside):
            kind = type(self.policy).__name__
            problem = (
                "a policy of gsl's own has no wiring, and nothing to audit; take policy=torch, onnx, sb3 or python"
            )
            raise ConfigError("policy", problem, given=kind)

    def look(self, console: Console) -> dict[str, Any]:
        """Show what goes where and what was checked; return it with the exit code that acting would have."""
        layout, policy = self.world.layout, self.policy
        assert isinstance(policy, Outside), "checked before"
        findings = [*audit(policy.wiring, policy.network().ports, layout)]
        if not any(finding.refused for finding in findings):
            findings += _try_out(self.world, policy)
        console.table("what the network sees", *_observation(policy.wiring, layout))
        console.table("what its outputs do", *_action(policy.wiring, layout))
        rows = [
            (finding.verdict, finding.what, f"{finding.setting}: {finding.line}".removeprefix(": "))
            for finding in findings
        ]
        console.table("audit of the wiring", ("", "of", "what was seen"), rows)
        wrong = sum(finding.refused for finding in findings)
        doubts = sum(bool(finding.setting) for finding in findings) - wrong
        said = (
            f"the policy would be refused ({wrong})"
            if wrong
            else f"the wiring fits; {several(doubts, 'line')} to look at"
        )
        return {"findings": [finding._asdict() for finding in findings], "said": said, "exit_code": 2 * bool(wrong)}


def _observation(wiring: Wiring, layout: Layout) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    rows: list[tuple[str, ...]] = []
    start = 0
    for part in wiring.parts(layout):
        end, zero = start + len(part.names) - 1, _few(part.zero)
        unit = UNITS.get(part.signal, "")
        rows.append((f"{start}-{end}", part.signal, unit, ", ".join(part.names), _few(part.scale), zero))
        start = end + 1
    return ("numbers", "signal", "unit", "in this order", "scale", "from"), rows


def _action(wiring: Wiring, layout: Layout) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    if layout.choices:
        return ("outputs", "do"), [(f"0-{layout.choices - 1}", "the largest is the choice")]
    scale = factors(wiring.scale, wiring.outputs(layout), "policy.wiring.scale")
    pose = dict(zip(layout.joints, wiring.stance(layout), strict=True))
    rows: list[tuple[str, ...]] = [
        (str(k), joint, f"{pose[joint]:g}", f"{scale[k]:g}") for k, joint in enumerate(wiring.moves(layout))
    ]
    return ("output", "moves", "from", "scale"), rows


def _few(values: np.ndarray) -> str:
    return f"{values[0]:g}" if np.ptp(values) == 0.0 else ", ".join(f"{value:g}" for value in values)


def _try_out(world: World, policy: Outside) -> Iterator[Finding]:
    """Yield what is seen at the beginning of an episode: ranges of the pose, of what is seen, and of what is done."""
    layout, env = world.layout, world.make()
    try:
        yield from _pose(policy.wiring, layout, env)
        posture = policy.wiring.stance(layout)
        observation, _ = env.reset(seed=0, options={"posture": posture} if not layout.states else None)
    finally:
        env.close()
    eyes = Eyes(policy.wiring, layout)
    seen = eyes.look(observation)
    least, most = f"{seen.min():.3g}", f"{seen.max():.3g}"
    line = f"at the start the network sees numbers from {least} to {most}"
    if np.abs(seen).max() > LARGE:
        names = [f"{part.signal} {name}" for part in policy.wiring.parts(layout) for name in part.names]
        worst = names[int(np.argmax(np.abs(seen))) % len(names)]
        yield Finding("ranges", f"{line}; the largest is {worst}: is its scale meant?", "policy.wiring.observation")
    else:
        yield Finding("ranges", line)
    try:
        outputs = _answer(policy, seen, layout)
    except GslError as error:
        yield Finding("outputs", str(error), "policy", refused=True)
        return
    yield _first_action(policy.wiring, layout, env, outputs)
    if not layout.choices:  # a small change seldom makes another choice
        yield _deaf(policy, seen, outputs, layout)


def _answer(policy: Outside, seen: np.ndarray, layout: Layout) -> np.ndarray:
    """Return the first outputs of an episode, shape (n_outputs,)."""
    return check_outputs(policy.network().begin()(seen), policy.wiring, layout, policy.name)


def _pose(wiring: Wiring, layout: Layout, env: gymnasium.Env) -> Iterator[Finding]:
    if layout.states or not isinstance(env.action_space, gymnasium.spaces.Box):
        return
    pose, low, high = wiring.stance(layout), env.action_space.low, env.action_space.high
    outside = [k for k in range(len(pose)) if wiring.pose and not low[k] <= pose[k] <= high[k]]
    if outside:
        k = outside[0]
        problem = f"puts {layout.joints[k]} at {pose[k]:g} rad; it goes from {low[k]:.3g} to {high[k]:.3g}"
        yield Finding("ranges", problem, f"policy.wiring.pose.{layout.joints[k]}", refused=True)
    else:
        yield Finding("ranges", "the default pose is within the joints' ranges")


def _first_action(wiring: Wiring, layout: Layout, env: gymnasium.Env, outputs: np.ndarray) -> Finding:
    action = Hands(wiring, layout).act(outputs)
    if layout.states or not isinstance(env.action_space, gymnasium.spaces.Box):
        return Finding("ranges", f"its first outputs are {', '.join(f'{value:.3g}' for value in outputs[:6])}")
    moved = np.abs(action - wiring.stance(layout))
    k = int(np.argmax(moved))
    line = f"its first action moves {layout.joints[k]} most, by {moved[k]:.2g} rad"
    beyond = (action < env.action_space.low) | (action > env.action_space.high)
    if beyond.any():
        name = layout.joints[int(np.argmax(beyond))]
        return Finding("ranges", f"{line}, and {name} beyond its range; is the scale meant?", "policy.wiring.scale")
    return Finding("ranges", line)


def _deaf(policy: Outside, seen: np.ndarray, outputs: np.ndarray, layout: Layout) -> Finding:
    """Return which numbers do not matter to the network: a term in the wrong place often meets inputs that are deaf."""
    names = [f"{part.signal} {name}" for part in policy.wiring.parts(layout) for name in part.names]
    deaf = []
    for k in range(len(seen)):
        changed = [seen + sign * np.eye(len(seen))[k] for sign in (1.0, -1.0)]
        if all(np.array_equal(_answer(policy, other, layout), outputs) for other in changed):
            deaf.append(names[k % len(names)])
    if not deaf:
        return Finding("inputs", "every number that it sees changes what it does")
    few = ", ".join(deaf[:4]) + (f" and {len(deaf) - 4} more" if len(deaf) > 4 else "")
    return Finding("inputs", f"no change of what it does by {few}", "policy.wiring.observation")
