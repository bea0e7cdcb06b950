"""An arm of two joints for blind benchmarks that take seconds; worlds name it `blind_arm.arm`."""

import numpy as np

from gsl.core.body import Joint, Link, Robot


def arm() -> Robot:
    """Two links that hang from a fixed base, with axes at right angles."""
    inertia = np.diag([4e-4, 4e-4, 1e-4])
    links = [Link(name, 0.4, np.array([0.0, 0.0, -0.06]), inertia) for name in ("base", "upper", "lower")]
    across, along = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    joints = (
        Joint("shoulder", "base", "upper", np.zeros(3), across, -1.5, 1.5, 6.0, 3.0, 0.005),
        Joint("elbow", "upper", "lower", np.array([0.0, 0.0, -0.12]), along, -1.5, 1.5, 6.0, 3.0, 0.005),
    )
    gains = {"shoulder": (40.0, 1.0), "elbow": (40.0, 1.0)}
    return Robot("arm", {link.name: link for link in links}, joints, tuple(gains), gains=gains, encoder_step=0.0015)
