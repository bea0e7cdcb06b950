"""The audit of a wiring: do names, shapes, order of joints and ranges of a network fit a world? A line for each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.core.layout import Layout
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.policies.signals import OF_JOINTS
from gsl.policies.wired import output_ends
from gsl.policies.wiring import Part, Wiring, check_joints

if TYPE_CHECKING:
    from gsl.policies.outside import Ports


class Finding(NamedTuple):
    """A line of the audit.

    Attributes:
        what: Was checked: names, inputs, outputs, order or ranges.
        line: What was seen.
        setting: That is wrong; nothing where all is well.
        refused: Whether the policy cannot act like this.
    """

    what: str
    line: str
    setting: str = ""
    refused: bool = False

    @property
    def verdict(self) -> str:
        """In a word."""
        return "wrong" if self.refused else "look" if self.setting else "fits"

    def insist(self) -> None:
        """Refuse what is wrong.

        Raises:
            ConfigError: It is.
        """
        if self.refused:
            raise ConfigError(self.setting, self.line)


def audit(wiring: Wiring, ports: Ports, layout: Layout) -> Iterator[Finding]:
    """Yield what was checked.

    Args:
        wiring: Of the network.
        ports: Of the network.
        layout: Of the world.

    Raises:
        ConfigError: A name is wrong, so that there is nothing to check.
    """
    check_joints(wiring, layout)
    parts, moves = wiring.parts(layout), wiring.moves(layout)
    yield Finding("names", f"found in this world: {several(len(parts), 'signal')}, {several(len(moves), 'joint')}")
    yield _inputs(wiring, parts, ports.inputs)
    yield _outputs(wiring, layout, ports)
    yield from _order(parts, moves)
    yield from _ranges(wiring, ports, layout)


def _inputs(wiring: Wiring, parts: tuple[Part, ...], inputs: int | None) -> Finding:
    sizes = " + ".join(f"{part.signal} {len(part.names)}" for part in parts)
    total = wiring.history * sum(len(part.names) for part in parts)
    times = f", {wiring.history} times" if wiring.history > 1 else ""
    if inputs is None:
        return Finding(
            "inputs", f"the wiring gives {several(total, 'number')} ({sizes}{times}); the network does not say how many"
        )
    if inputs != total:
        problem = f"gives {several(total, 'number')} ({sizes}{times}), but the network takes {inputs}"
        return Finding("inputs", problem, "policy.wiring.observation", refused=True)
    return Finding("inputs", f"the network takes {several(inputs, 'number')}: {sizes}{times}")


def _outputs(wiring: Wiring, layout: Layout, ports: Ports) -> Finding:
    outputs = ports.outputs
    count = wiring.outputs(layout)
    if layout.choices and ports.ends is not None:
        problem = "the network acts within a range, but the actions of this world are choices"
        return Finding("outputs", problem, "policy", refused=True)
    what = several(count, "choice" if layout.choices else "joint" if not layout.states else "action")
    if outputs is None:
        return Finding("outputs", f"outputs are due for {what}; the network does not say how many it has")
    if outputs != count and not (layout.choices and outputs == 1):
        problem = f"names {what}, but the network has {several(outputs, 'output')}"
        return Finding("outputs", problem, "policy.wiring.joints", refused=True)
    return Finding("outputs", f"the network has {several(outputs, 'output')} for {what}")


def _order(parts: tuple[Part, ...], moves: tuple[str, ...]) -> Iterator[Finding]:
    """Networks are trained with one order of joints: another one in a part of the wiring is most likely a mistake."""
    for k, part in enumerate(parts):
        if part.signal not in OF_JOINTS or set(part.names) != set(moves):
            continue
        if part.names == moves:
            yield Finding("order", f"{part.signal} has the joints in the order of the outputs")
            continue
        place = next(k for k, (ours, theirs) in enumerate(zip(part.names, moves, strict=True)) if ours != theirs)
        problem = f"{part.signal} has {part.names[place]} where the outputs have {moves[place]}; is that meant?"
        yield Finding("order", problem, f"policy.wiring.observation.{k}.joints")


def _ranges(wiring: Wiring, ports: Ports, layout: Layout) -> Iterator[Finding]:
    if ports.ends is None or not layout.ranges:
        return
    ours, theirs = np.array(output_ends(wiring, layout)), np.array(ports.ends)
    if ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=1e-5):
        yield Finding("ranges", "the network was trained with the actions' range of this world")
        return
    both = [", ".join(f"{low:g} to {high:g}" for low, high in ends.T) for ends in (theirs, ours)]
    problem = f"the network was trained with actions of {both[0]}, this world takes {both[1]}; set a scale"
    yield Finding("ranges", problem, "policy.wiring.scale", refused=True)
