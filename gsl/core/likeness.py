"""Names that are alike, found in a time that no file can stretch, however long and many its names are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from itertools import islice

COMPARED, CHOICES = 100, 1000  # letters of a name, and names: comparing takes the product of their lengths


def find_alike(word: str, choices: Iterable[str], *, most: int = 1, cutoff: float = 0.6) -> list[str]:
    """Return the choices that are most like a word, best first.

    Args:
        word: What was said.
        choices: What there is, of which the first thousand are looked at, and of each the first hundred letters.
        most: That are returned.
        cutoff: Likeness that is needed, 1 for the same.
    """
    begins = {choice[:COMPARED]: choice for choice in islice(choices, CHOICES)}
    return [begins[near] for near in difflib.get_close_matches(word[:COMPARED], begins, n=most, cutoff=cutoff)]
