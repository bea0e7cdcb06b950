"""Seeds of rollouts, derived from what a rollout is and never from who runs it or when."""

from __future__ import annotations

from zlib import crc32

import numpy as np

_STREAM = 7


def derive_seed(*parts: int | str) -> int:
    """Return a seed in [0, 2**31) that is a function of `parts`, such as (run seed, "optimize", generation)."""
    entropy = [crc32(part.encode()) if isinstance(part, str) else part for part in parts]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0] >> 1)


def grounding_generator(seed: int) -> np.random.Generator:
    """Return the randomness of a grounding in an episode, set apart from that of the world, whose seed is the same."""
    return np.random.default_rng([seed, _STREAM])


def seed_of_round(seed: int, number: int) -> int:
    """Return the seed of a round, the first being 1."""
    return seed + 1000 * (number - 1)
