"""What a format cannot hold of trajectories: whatever is there, but for what its writer says that it writes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gsl.core.trajectory import Batch

LAST, TIME, VELOCITY = "last state", "time", "velocity"
GROUNDED, REWARD, FELL, SENSORS = "grounded action", "reward", "fell", "sensors"


def list_omissions(batch: Batch, *held: str) -> list[str]:
    """Return in words what is lost: with every format what is known of an episode, such as the motion it is of.

    Args:
        batch: Trajectories.
        held: What the writer holds besides actions, and positions or states; also sensors and metadata by name.
    """
    return [words for part, words in _parts(batch, {*held}) if part not in held]


def _parts(batch: Batch, held: set[str]) -> Iterator[tuple[str, str]]:
    """Yield what there is, with words for its loss."""
    episodes = batch.episodes
    yield LAST, "the state after the last action of an episode"
    yield TIME, "when each row was measured"
    if not batch.states:
        yield VELOCITY, "velocities"
    if any(episode.grounded_action is not None for episode in episodes):
        yield GROUNDED, "what a grounding sent instead of an action"
    if any(episode.reward is not None for episode in episodes):
        yield REWARD, "rewards"
    if any(episode.ended_in_a_fall for episode in episodes):
        yield FELL, "since when the robot lies on the ground"
    if sensors := sorted({name for episode in episodes for name in episode.sensors} - held):
        yield SENSORS, f"sensors: {', '.join(sensors)}"
    about = batch.metadata.get("episodes") or []
    if labels := sorted({name for label in about if isinstance(label, Mapping) for name in label}):
        yield "labels", f"labels of the episodes: {', '.join(labels)}"
    if keys := sorted({*batch.metadata} - {"episodes"} - held):
        yield "metadata", f"metadata: {', '.join(keys)}"
