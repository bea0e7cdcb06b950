"""Numbers and frames as a URDF writes them."""

from __future__ import annotations

from xml.etree import ElementTree as xml

import numpy as np

from gsl.robots.frames import euler


def read_origin(node: xml.Element) -> tuple[np.ndarray, np.ndarray]:
    """Return the place [m], shape (3,), and the turn, shape (3, 3), of what has an <origin>, or none."""
    origin = find_only(node, "origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    place = read_numbers(origin.get("xyz", "0 0 0"), 3, "xyz of an <origin>")
    return np.array(place), euler(*read_numbers(origin.get("rpy", "0 0 0"), 3, "rpy of an <origin>"))


def find_only(node: xml.Element, tag: str) -> xml.Element | None:
    """Return the element of an element, None if there is none.

    Raises:
        ValueError: There are several, and it is not said which of them counts.
    """
    elements = node.findall(tag)
    if len(elements) > 1:
        raise ValueError(f"has {len(elements)} <{tag}> where one counts; keep one")
    return elements[0] if elements else None


def read_number(node: xml.Element | None, key: str, where: str, missing: float | None = None) -> float:
    """Return a number that an element says, `missing` where it does not.

    Raises:
        ValueError: It says none, or something else.
    """
    text = None if node is None else node.get(key)
    if text is None and missing is not None:
        return missing
    if text is None:
        raise ValueError(f"{where} lacks {key}")
    return read_numbers(text, 1, f"{key} of {where}")[0]


def read_numbers(text: str, count: int, where: str) -> tuple[float, ...]:
    """Return so many finite numbers, side by side in a text.

    Raises:
        ValueError: They are others.
    """
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise ValueError(f"{where} must be {wanted}, not '{text}'")
    return values
