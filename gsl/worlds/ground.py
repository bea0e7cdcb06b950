"""The ground in Bullet: a plane, or a random surface of triangles; hard, or soft as a spring at every contact point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gsl.core.plant import Contact

REACH = 2.5  # half the edge of a random surface [m]: 7.5 s at 30 cm/s, and a foot
FLAT = 0.15  # radius of the flat place in its middle [m]: both soles
BELOW = 0.05  # a plane this much lower lies under a random surface and goes on beyond it [m]
# The visual keeps Bullet from preparing to draw the plane at every load, which takes half a millisecond.
PLANE = """<robot name="ground"><link name="ground"><inertial><mass value="0"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>
<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>
<collision><geometry><plane normal="0 0 1"/></geometry></collision></link></robot>"""


def random_heights(contact: Contact, rng: np.random.Generator) -> np.ndarray:
    """Draw a surface: heights [m] at points of a grid over y and x, evenly from 0 to the roughness, 0 in the middle.

    Returns:
        Shape (n, n), n odd.
    """
    half = math.ceil(REACH / contact.spacing)
    along = contact.spacing * np.arange(-half, half + 1)
    heights = rng.uniform(0.0, contact.roughness, (len(along), len(along)))
    heights[np.hypot(along[:, None], along) <= FLAT + math.sqrt(2.0) * contact.spacing] = 0.0
    return heights


def lay(
    bullet: Any, client: int, plane: str, contact: Contact, heights: np.ndarray | None, x: float, y: float
) -> tuple[int, ...]:
    """Put the ground into an empty world and return Bullet's numbers of its bodies.

    Args:
        bullet: The module.
        client: pybullet's number of the client.
        plane: Path of a file that holds `PLANE`.
        contact: Friction, stiffness and damping, spacing of the grid points.
        heights: Of a surface at its grid points [m], shape (n, n), or None for the plane alone.
        x: Where the middle of the surface is [m].
        y: Likewise.
    """
    below = 0.0 if heights is None else -BELOW
    bodies = [bullet.loadURDF(plane, basePosition=[0.0, 0.0, below], physicsClientId=client)]
    if heights is not None:
        bodies.append(_surface(bullet, client, heights, contact.spacing, x, y))
    for body in bodies:
        bullet.changeDynamics(body, -1, lateralFriction=contact.ground_friction, physicsClientId=client)
        if contact.stiffness is not None:  # Bullet cannot switch it off again; an emptied world forgets it
            bullet.changeDynamics(
                body, -1, contactStiffness=contact.stiffness, contactDamping=contact.damping, physicsClientId=client
            )
    return tuple(bodies)


def _surface(bullet: Any, client: int, heights: np.ndarray, spacing: float, x: float, y: float) -> int:
    """Make a height field; Bullet puts the middle of its range of heights at the body's origin."""
    shape = bullet.createCollisionShape(
        bullet.GEOM_HEIGHTFIELD,
        meshScale=[spacing, spacing, 1.0],
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=len(heights),
        numHeightfieldColumns=len(heights),
        physicsClientId=client,
    )
    middle = 0.5 * float(heights.min() + heights.max())
    body: int = bullet.createMultiBody(0, shape, basePosition=[x, y, middle], physicsClientId=client)
    return body
