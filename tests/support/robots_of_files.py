"""Independent words on a robot: sums of textbook Jacobians, and what Bullet itself reads in a URDF."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics, jacobian
from gsl.worlds.engine import quiet


def holding(body: Robot, angles: dict[str, float]) -> np.ndarray:
    """Torques that hold a pose against gravity [N·m], as sums of textbook Jacobians."""
    body = lump(body)
    frames, total = forward_kinematics(body, angles), np.zeros(len(body.motors))
    for link in body.links.values():
        total += 9.81 * link.mass * jacobian(body, frames, link.name, link.com)[1][2, 6:]
    return total


class BulletReading:
    """A URDF as Bullet reads it, its base fixed."""

    def __init__(self, bullet, client: int, path: Path) -> None:
        self._bullet, self._client = bullet, client
        self._body = bullet.loadURDF(
            str(path), useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
        )
        bullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
        rows = [bullet.getJointInfo(self._body, i, client) for i in range(bullet.getNumJoints(self._body, client))]
        self.joints = [row[1].decode() for row in rows if row[2] != bullet.JOINT_FIXED]

    def holding(self, angles: Mapping[str, float]) -> dict[str, float]:
        """Torques [N·m] that hold a pose [rad]."""
        pose, still = [angles.get(name, 0.0) for name in self.joints], [0.0] * len(self.joints)
        torques = self._bullet.calculateInverseDynamics(self._body, pose, still, still, physicsClientId=self._client)
        return dict(zip(self.joints, torques, strict=True))

    def inertia(self, angles: Mapping[str, float]) -> np.ndarray:
        """Mass matrix in a pose [rad]."""
        pose = [angles.get(name, 0.0) for name in self.joints]
        return np.array(self._bullet.calculateMassMatrix(self._body, pose, physicsClientId=self._client))


@contextmanager
def as_bullet_reads(path: Path) -> Iterator[BulletReading]:
    with quiet():
        import pybullet

        client = pybullet.connect(pybullet.DIRECT)
        reading = BulletReading(pybullet, client, path)
    try:
        yield reading
    finally:
        pybullet.disconnect(client)
