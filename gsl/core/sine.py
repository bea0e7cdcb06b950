"""Sine and cosine from sums and products alone, so that they work in lanes and have the same bits on every machine."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner

_QUARTER, _REST = 1.57079632673412561417, 6.07710050650619224932e-11  # π/2; the first times a whole number is exact
# Coefficients within a quarter turn, from fdlibm's k_sin.c and k_cos.c (Sun Microsystems 1993): errors below 1e-16.
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@compile_inner
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return both of an angle [rad], a float or lanes: to 1e-15 within thousands of turns."""
    quarters = np.rint(angle * (1.0 / (_QUARTER + _REST)))
    r = (angle - quarters * _QUARTER) - quarters * _REST
    z = r * r
    s = r + r * z * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
    c = 1.0 - 0.5 * z + z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6)))))
    turn = quarters - 4.0 * np.rint(0.25 * quarters)  # -2 to 2
    across = 1.0 - abs(turn)  # cosine of that many quarters
    along = turn * (1.0 + across)  # their sine
    return s * across + c * along, c * across - s * along
