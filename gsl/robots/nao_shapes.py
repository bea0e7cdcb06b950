"""What the NAO looks like: primitive shapes by left or middle link; only the sole collides.

The sole's box is that of bhuman/BHumanCodeRelease, Config/Scenes/Includes/NaoV6H25.rsi2; the others only show.
"""

from __future__ import annotations

from gsl.core.body import Shape

Triple = tuple[float, float, float]

_FOOT_HEIGHT = 0.04519
_WHITE, _GREY, _DARK, _ORANGE, _BLUE = (
    (0.97, 0.97, 0.98),
    (0.52, 0.55, 0.6),
    (0.16, 0.17, 0.2),
    (0.95, 0.42, 0.12),
    (0.3, 0.72, 0.95),
)


def _box(size: Triple, centre: Triple, colour: Triple = _WHITE) -> Shape:
    return Shape("box", size, centre, colour=colour)


def _ball(radius: float, centre: Triple = (0.0, 0.0, 0.0), colour: Triple = _WHITE) -> Shape:
    return Shape("sphere", (radius,), centre, colour=colour)


def _rod(radius: float, length: float, along: str, centre: Triple = (0.0, 0.0, 0.0), colour: Triple = _WHITE) -> Shape:
    return Shape("cylinder", (radius, length), centre, colour=colour, along=along)


SOLE = Shape("box", (0.15, 0.075, 0.03), (0.02, 0.003, -_FOOT_HEIGHT + 0.015), collides=True, colour=_GREY)

SHAPES = {
    "torso": (
        _box((0.095, 0.125, 0.105), (-0.005, 0.0, 0.062)),
        _rod(0.05, 0.125, "y", (-0.005, 0.0, 0.085)),
        _box((0.03, 0.05, 0.075), (0.047, 0.0, 0.055), _GREY),
        _rod(0.016, 0.03, "x", (0.055, 0.0, 0.052), _BLUE),
        _rod(0.045, 0.06, "z", (-0.005, 0.0, -0.015), _GREY),
        _box((0.085, 0.11, 0.055), (-0.005, 0.0, -0.062)),
        _box((0.07, 0.03, 0.05), (0.0, 0.0, -0.095), _GREY),
    ),
    "Neck": (_rod(0.026, 0.04, "z", (0.0, 0.0, -0.01), _GREY),),
    "Head": (
        _ball(0.062, (0.0, 0.0, 0.058)),
        _rod(0.054, 0.09, "y", (0.0, 0.0, 0.055)),
        _rod(0.034, 0.134, "y", (0.0, 0.0, 0.055), _ORANGE),
        _rod(0.022, 0.142, "y", (0.0, 0.0, 0.055)),
        _rod(0.0165, 0.016, "x", (0.054, 0.024, 0.062), _DARK),
        _rod(0.0165, 0.016, "x", (0.054, -0.024, 0.062), _DARK),
        _rod(0.011, 0.018, "x", (0.055, 0.024, 0.062), _BLUE),
        _rod(0.011, 0.018, "x", (0.055, -0.024, 0.062), _BLUE),
        _ball(0.007, (0.062, 0.0, 0.036), _DARK),
        _ball(0.008, (0.055, 0.0, 0.092), _DARK),
    ),
    "LPelvis": (_ball(0.032, (-0.004, 0.0, 0.014), _GREY),),
    "LThigh": (
        _rod(0.035, 0.052, "y", (0.0, 0.0, 0.0), _ORANGE),
        _box((0.066, 0.06, 0.062), (0.004, 0.003, -0.044)),
        _rod(0.033, 0.06, "y", (0.004, 0.003, -0.075)),
    ),
    "LTibia": (
        _rod(0.030, 0.066, "y", (0.0, 0.0, 0.0), _ORANGE),
        _rod(0.031, 0.05, "z", (0.004, 0.002, -0.035)),
        _box((0.062, 0.058, 0.05), (0.004, 0.002, -0.065)),
    ),
    "LAnkle": (_ball(0.027, colour=_GREY),),
    "LFoot": (
        SOLE,
        _box((0.085, 0.066, 0.02), (-0.002, 0.003, -0.012)),
        _rod(0.018, 0.068, "y", (0.055, 0.003, -0.026)),
        _rod(0.02, 0.066, "y", (-0.035, 0.003, -0.018)),
    ),
    "LShoulder": (_ball(0.036, (0.0, -0.004, 0.0), _ORANGE),),
    "LBicep": (_rod(0.026, 0.075, "x", (0.05, 0.01, 0.0)), _rod(0.03, 0.03, "x", (0.04, 0.01, 0.0))),
    "LElbow": (_ball(0.026, colour=_GREY),),
    "LForeArm": (_rod(0.024, 0.055, "x", (0.03, 0.0, 0.0)), _rod(0.028, 0.025, "x", (0.035, 0.0, 0.0), _ORANGE)),
    "LHand": (
        _ball(0.022, (0.022, 0.0, 0.0)),
        _rod(0.008, 0.04, "x", (0.05, 0.01, -0.004), _GREY),
        _rod(0.008, 0.04, "x", (0.05, -0.01, -0.004), _GREY),
        _rod(0.008, 0.032, "x", (0.045, 0.0, 0.014), _GREY),
    ),
}
