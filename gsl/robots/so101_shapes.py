"""What the SO-101 looks like: boxes by link, most from mujoco_menagerie (Apache-2.0); none collides."""

from __future__ import annotations

from gsl.core.body import Shape

Triple = tuple[float, float, float]

_PRINT, _SERVO, _JAW = (0.95, 0.72, 0.2), (0.16, 0.17, 0.2), (0.85, 0.6, 0.15)


def _box(centre: Triple, half: Triple, colour: Triple = _PRINT) -> Shape:
    x, y, z = half
    return Shape("box", (2.0 * x, 2.0 * y, 2.0 * z), centre, colour=colour)


SHAPES = {
    "base": (  # no source has boxes of the base: about its centre of mass, flat on the table
        _box((0.014, 0.0, 0.033), (0.045, 0.03, 0.033)),
        _box((-0.02, 0.0, 0.008), (0.045, 0.05, 0.008)),
    ),
    "shoulder": (
        _box((-0.0304, 0.0004, -0.0387), (0.015, 0.010, 0.023), _SERVO),
        _box((-0.025, 0.0, 0.0), (0.025, 0.020, 0.038)),
    ),
    "upper_arm": (
        _box((-0.06, 0.0, 0.02), (0.07, 0.01, 0.03)),
        _box((-0.12, -0.014, 0.0182), (0.01, 0.02, 0.015), _SERVO),
    ),
    "lower_arm": (
        _box((-0.05, 0.0, 0.0182), (0.07, 0.01, 0.03)),
        _box((-0.125, 0.005, 0.018), (0.023, 0.013, 0.018), _SERVO),
    ),
    "wrist": (
        _box((0.0, -0.0424, 0.0256), (0.015, 0.018, 0.029), _SERVO),
        _box((0.0, -0.02, 0.0191), (0.010, 0.030, 0.027)),
    ),
    "gripper": (
        _box((-0.0025, 0.0, -0.022), (0.0325, 0.015, 0.015)),
        _box((-0.0125, 0.0, -0.066), (0.002, 0.010, 0.034), _JAW),
    ),
    "moving_jaw": (
        _box((0.0, -0.013, 0.019), (0.01, 0.01, 0.015), _SERVO),
        _box((-0.0095, -0.047, 0.019), (0.002, 0.033, 0.006), _JAW),
    ),
}
