"""Angles as outputs of a model: plain, or as sine and cosine, which a model cannot leave the circle with."""

from __future__ import annotations

from typing import Literal

import numpy as np

Encoding = Literal["plain", "sincos"]


def encode(angle: np.ndarray, encoding: Encoding) -> np.ndarray:
    """Return angles [rad], shape (..., n), as a model puts them out, shape (..., n) or, sines first, (..., 2 n)."""
    return angle if encoding == "plain" else np.concatenate([np.sin(angle), np.cos(angle)], axis=-1)


def decode(output: np.ndarray, encoding: Encoding) -> np.ndarray:
    """Return the angles [rad] that a model put out, shape (..., n)."""
    if encoding == "plain":
        return output
    half = output.shape[-1] // 2
    angle: np.ndarray = np.arctan2(output[..., :half], output[..., half:])
    return angle
