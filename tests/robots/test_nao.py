import numpy as np
import pytest

from gsl.core.body import lump
from gsl.core.plant import nominal
from gsl.robots.nao import CONTROLLED, FOOT_HEIGHT, HIP_OFFSET_Y, HIP_OFFSET_Z, THIGH, TIBIA, nao
from gsl.robots.nao_legs import leg_angles
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.start import resting

MIRROR = np.diag([1.0, -1.0, 1.0])

PUBLISHED = {  # lower, upper [rad], speed [rad/s], effort [N·m] of naoV50.urdf
    "LHipYawPitch": (-1.14529, 0.740718, 4.16174, 3.348),
    "RHipYawPitch": (-1.14529, 0.740718, 4.16174, 3.348),
    "LHipRoll": (-0.379435, 0.79046, 4.16174, 3.348),
    "RHipRoll": (-0.79046, 0.379435, 4.16174, 3.348),
    "LHipPitch": (-1.53589, 0.48398, 6.40239, 3.023),
    "RKneePitch": (-0.0923279, 2.11255, 6.40239, 3.023),
    "LAnklePitch": (-1.18944, 0.922581, 6.40239, 3.023),
    "RAnkleRoll": (-0.768992, 0.397761, 4.16174, 3.348),
    "LShoulderPitch": (-2.08567, 2.08567, 8.26797, 1.329),
    "LShoulderRoll": (-0.314159, 1.32645, 7.19407, 1.7835),
    "RShoulderRoll": (-1.32645, 0.314159, 7.19407, 1.7835),
}


def test_the_robot_has_the_published_mass_limits_and_joints() -> None:
    robot = nao()
    assert robot.mass == pytest.approx(5.305, abs=1e-3)
    assert len(robot.controlled) == 15 and len(robot.motors) == 16
    assert robot.drive.tolist() == [*range(15), 0]
    for name, published in PUBLISHED.items():
        joint = robot.joint(name)
        assert (joint.lower, joint.upper, joint.max_velocity, joint.effort) == published


def test_rotor_inertia_is_gear_ratio_squared_times_the_rotor() -> None:
    robot = nao()
    assert robot.joint("LHipRoll").armature == pytest.approx(0.0162, abs=1e-4)
    assert robot.joint("RKneePitch").armature == pytest.approx(0.00685, abs=1e-4)
    assert robot.joint("LShoulderPitch").armature == pytest.approx(0.00196, abs=1e-4)


def test_left_and_right_are_mirror_images() -> None:
    robot = nao()
    for name in robot.links:
        if name.startswith("L"):
            left, right = robot.links[name], robot.links["R" + name[1:]]
            assert left.mass == right.mass
            np.testing.assert_array_equal(MIRROR @ left.com, right.com)
            np.testing.assert_array_equal(MIRROR @ left.inertia @ MIRROR, right.inertia)
    plant = nominal(robot)
    motors = list(robot.motors)
    for left in (name for name in motors if name.startswith("L")):
        i, k = motors.index(left), motors.index("R" + left[1:])
        assert all(getattr(plant.servo, row)[i] == getattr(plant.servo, row)[k] for row in plant.servo._fields)


def test_every_inertia_tensor_is_that_of_a_body() -> None:
    for robot in (nao(), lump(nao())):
        for link in robot.links.values():
            np.testing.assert_array_equal(link.inertia, link.inertia.T)
            moments = np.linalg.eigvalsh(link.inertia)
            assert moments[0] > 0.0 and moments[2] <= moments[0] + moments[1], link.name


def reachable(rng: np.random.Generator) -> tuple[float, np.ndarray]:
    """A shared hip angle and two ankle points in the legs' reach and limits."""
    robot = nao()
    while True:
        yaw, ankles = rng.uniform(-0.8, 0.3), rng.uniform((-0.08, -0.05, -0.2), (0.08, 0.05, -0.12), (2, 3))
        within_reach = np.linalg.norm(ankles, axis=1).max() < THIGH + TIBIA
        if within_reach and all(
            within_limits(robot, side, solved(ankle, yaw, side)) for side, ankle in zip("LR", ankles, strict=True)
        ):
            return yaw, ankles


def solved(ankle: np.ndarray, yaw: float, side: str) -> np.ndarray:
    angles = np.empty(5)
    leg_angles(ankle, yaw, 1.0 if side == "L" else -1.0, angles)
    return angles


def within_limits(robot, side: str, angles: np.ndarray) -> bool:
    names = ("HipRoll", "HipPitch", "KneePitch", "AnklePitch", "AnkleRoll")
    joints = [robot.joint(side + name) for name in names]
    return all(joint.lower <= angle <= joint.upper for joint, angle in zip(joints, angles, strict=True))


def test_leg_kinematics_agree_with_bullet() -> None:
    robot, rng = nao(), np.random.default_rng(1)
    engine = Engine(nominal(robot), Physics(0.002, 50, 0.02, floating=False))
    welded = lump(robot)
    for _ in range(300):
        yaw, ankles = reachable(rng)
        positions = np.zeros(16)
        positions[[0, 15]] = yaw
        positions[1:6], positions[6:11] = solved(ankles[0], yaw, "L"), solved(ankles[1], yaw, "R")
        start = resting(welded, positions, positions, floating=False)
        engine.load(start.reading, start.commands)
        for side, foot, ankle in zip((1.0, -1.0), ("LAnkleRoll", "RAnkleRoll"), ankles, strict=True):
            index = welded.motors.index(foot)
            state = engine.bullet.getLinkState(engine.body, engine.joints[index], physicsClientId=engine.client)
            hip = start.reading.place + (0.0, side * HIP_OFFSET_Y, -HIP_OFFSET_Z)
            np.testing.assert_allclose(np.array(state[4]) - hip, ankle, atol=1e-6)
            up = np.array(engine.bullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)[2]
            np.testing.assert_allclose(up, (0.0, 0.0, 1.0), atol=1e-6)
    engine.close()


def test_out_of_reach_the_leg_is_straight() -> None:
    assert solved(np.array([0.0, 0.0, -(THIGH + TIBIA) - 0.1]), 0.0, "L")[2] == pytest.approx(0.0, abs=1e-7)


def test_the_stance_stands_on_flat_soles() -> None:
    robot = lump(nao())
    positions = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    reading = resting(robot, positions, positions, floating=True).reading
    assert reading.place[2] == pytest.approx(0.23 + HIP_OFFSET_Z, abs=2e-3)
    assert robot.controlled == CONTROLLED and FOOT_HEIGHT < 0.05
