"""Uneven and soft ground in Bullet, and pushes, against what was drawn and what mechanics says."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import STANCE, held, walked, world
from scipy.spatial.transform import Rotation
from test_rotor import momentum

from gsl.core.body import lump
from gsl.core.plant import Contact, Push, nominal
from gsl.errors import GslError
from gsl.robots.nao import nao
from gsl.worlds.bullet import BulletEnv
from gsl.worlds.engine import Engine
from gsl.worlds.ground import FLAT, REACH, random_heights
from gsl.worlds.physics import Physics
from gsl.worlds.pushes import overlap
from gsl.worlds.start import resting

ROUGH = {"uneven_ground": {"height": 0.01, "spacing": 0.1}}
DRIVE = nao().drive


@pytest.fixture(scope="module")
def rough():
    env = world(ROUGH).make()
    yield env
    env.close()


def heights_in_bullet(env: BulletEnv, points: np.ndarray) -> np.ndarray:
    """Height of the ground at points [m], shape (n, 2), by rays from above."""
    engine = env.engine
    assert engine is not None
    engine.bullet.removeBody(engine.body, engine.client)
    engine.body = -1
    rays = [np.column_stack([points, np.full(len(points), z)]).tolist() for z in (1.0, -1.0)]
    return np.array([hit[3][2] for hit in engine.bullet.rayTestBatch(*rays, physicsClientId=engine.client)])


def test_heights_are_drawn_evenly_and_flat_in_the_middle() -> None:
    for spacing in (0.05, 0.1, 0.3):
        heights = random_heights(Contact(roughness=0.01, spacing=spacing), np.random.default_rng(0))
        half = len(heights) // 2
        away = spacing * np.hypot(*np.indices(heights.shape) - half)
        assert heights.shape == (2 * half + 1, 2 * half + 1) and half * spacing >= REACH
        assert (heights[away <= FLAT + spacing] == 0.0).all()
        drawn = heights[away > FLAT + 1.5 * spacing]
        assert drawn.min() >= 0.0 and drawn.max() <= 0.01
        assert drawn.mean() == pytest.approx(0.005, rel=0.1) and drawn.std() == pytest.approx(0.01 / 12**0.5, rel=0.1)


def test_bullets_surface_is_the_one_that_was_drawn(rough: BulletEnv) -> None:
    rough.reset(seed=5)
    heights = random_heights(rough.world.plant.contact, np.random.default_rng(5).spawn(1)[0])
    rows = np.random.default_rng(1).integers(1, len(heights) - 1, (40, 2))
    points = 0.1 * (rows[:, ::-1] - len(heights) // 2) + 1e-6
    np.testing.assert_allclose(heights_in_bullet(rough, points), heights[tuple(rows.T)], atol=1e-5)


def test_a_seed_has_its_surface_whatever_came_before_and_nothing_piles_up(rough: BulletEnv) -> None:
    first = walked(rough, 1, 0.6)
    other = walked(rough, 2, 0.6)
    assert not np.array_equal(first, other)
    for _ in range(3):
        rough.reset()
        for _ in range(4):
            rough.step(STANCE)
    np.testing.assert_array_equal(walked(rough, 1, 0.6), first)
    fresh = world(ROUGH).make()
    np.testing.assert_array_equal(walked(fresh, 2, 0.6), other)
    fresh.close()
    engine = rough.engine
    assert engine is not None and engine.bullet.getNumBodies(engine.client) == 3


def test_a_seed_starts_alike_on_every_ground() -> None:
    begun = []
    for effects in ({}, ROUGH):
        env = world({**effects, "encoder_noise": {"sd": 0.001}}, settle=0.0).make()
        begun.append([env.reset(seed=seed)[0][env.layout["position"]] for seed in (1, 2)])
        env.close()
    np.testing.assert_array_equal(*begun)


def test_every_episode_has_another_surface(rough: BulletEnv) -> None:
    points = np.array([[0.5, 0.2], [1.0, -0.7], [-0.6, 1.3]])
    rough.reset(seed=0)
    surfaces = [heights_in_bullet(rough, points)]
    for _ in range(3):
        rough.reset()
        surfaces.append(heights_in_bullet(rough, points))
    assert (np.std(surfaces, axis=0) > 1e-4).all()


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.2])
def test_standing_on_bumps_is_quiet_and_the_feet_carry_the_weight(spacing: float) -> None:
    """On random heights everywhere, soles on corners and edges: no jitter, no sinking."""
    rng, plant = np.random.default_rng(3), replace(nominal(nao()), contact=Contact(spacing=spacing))
    engine = Engine(plant, Physics(0.002, 50, 0.02, floating=True))
    targets = STANCE[DRIVE]
    start = resting(engine.robot, targets, targets, floating=True)
    place = start.reading.place + [0.0, 0.0, 0.005]
    engine.load(start.reading._replace(place=place), start.commands, heights=rng.uniform(0.0, 0.005, (21, 21)))
    for _ in range(100):
        engine.run(targets)
        engine.read()
    readings = []
    for _ in range(25):
        engine.run(targets)
        readings.append(engine.read())
    engine.close()
    assert np.mean([sum(reading.foot_force) for reading in readings]) == pytest.approx(nao().mass * 9.81, rel=0.02)
    assert np.ptp([reading.place[2] for reading in readings]) < 1e-4
    low, high = start.reading.place[2] - 1e-3, place[2] + 1e-3
    assert low < readings[-1].place[2] < high


def test_the_flat_start_is_as_high_as_the_plane(rough: BulletEnv) -> None:
    plane = world(start_noise=0.0).make()
    level = world(ROUGH, start_noise=0.0).make()
    heights = []
    for env in (plane, level):
        env.reset(seed=0, options={"posture": STANCE})
        heights.append([env.step(STANCE)[0][env.layout["base.position"]][2] for _ in range(25)][-1])
        env.close()
    assert heights[1] == pytest.approx(heights[0], abs=2e-4)


def test_a_rough_and_soft_ground_is_both() -> None:
    sunk = {}
    for stiffness in (3e3, 1e8):
        env = world({**ROUGH, "ground_compliance": {"stiffness": stiffness}}, start_noise=0.0).make()
        env.reset(seed=0, options={"posture": STANCE})
        sunk[stiffness] = [env.step(STANCE)[0][env.layout["base.position"]][2] for _ in range(25)][-1]
        env.close()
    assert sunk[1e8] - sunk[3e3] == pytest.approx(nao().mass * 9.81 / (8.0 * 3e3), rel=0.1)


def test_the_overlap_of_a_push_with_the_steps_is_its_duration() -> None:
    for start, end in ((0.1, 0.2), (0.1, 0.1137), (0.1013, 0.1017), (0.0999, 0.3)):
        push = Push("torso", np.ones(3), start, end)
        shares = [overlap(push, 0.002 * k, 0.002) for k in range(300)]
        assert 0.002 * sum(shares) == pytest.approx(end - start, abs=1e-8) and max(shares) < 1.0 + 1e-9


@pytest.mark.parametrize("link", ["torso", "LTibia", "Head", "LHand"])
def test_a_push_on_a_flying_robot_is_its_impulse_and_its_moment(link: str) -> None:
    """Momentum grows by force x time; angular momentum about the place of the link by the lever x that."""
    force, duration = np.array([3.0, -2.0, 1.0]), 0.0137
    after = []
    for push in ((), (Push(link, force, 0.0, duration),)):
        plant = replace(nominal(nao()), pushes=push, gravity=np.zeros(3))
        engine = Engine(plant, Physics(0.0005, 50, 0.02, floating=True))
        targets = STANCE[DRIVE]
        start = resting(engine.robot, targets, targets, floating=True)
        engine.load(start.reading._replace(place=np.array([0.0, 0.0, 1.0])), start.commands)
        engine.read()
        point = where(engine, link)
        engine.run(targets)
        after.append(momentum(engine))
        engine.close()
    gained = after[1] - after[0]
    np.testing.assert_allclose(gained[3:], force * duration, rtol=2e-3)
    np.testing.assert_allclose(gained[:3], np.cross(point, force * duration), atol=3e-4)


def where(engine: Engine, link: str) -> np.ndarray:
    """Centre of mass of a link with the base upright at 1 m [m], from the robot with its fixed joints."""
    robot = nao()
    point, angles = robot.links[link].com, dict(zip(robot.motors, engine.read().motion[0], strict=True))
    above = {joint.child: joint for joint in robot.joints}
    while link in above:
        joint = above[link]
        angle = angles.get(joint.name, joint.fixed_at)
        point, link = joint.origin + Rotation.from_rotvec(angle * joint.axis).apply(point), joint.parent
    return point + [0.0, 0.0, 1.0]


def test_a_held_base_does_not_feel_a_push() -> None:
    rows = []
    for effects in ({}, {"external_push": {"link": "torso", "x": 20.0, "start": 0.0, "duration": 1.0}}):
        env = held(effects).make()
        env.reset(seed=0, options={"posture": STANCE})
        rows.append([env.step(STANCE)[0] for _ in range(10)])
        env.close()
    np.testing.assert_allclose(rows[1], rows[0], atol=1e-9)


def test_who_comes_to_the_edge_of_random_ground_is_told_so(rough: BulletEnv) -> None:
    targets = STANCE[DRIVE]
    start = resting(lump(nao()), targets, targets, floating=True)
    thrown = start._replace(reading=start.reading._replace(velocity=np.array([60.0 * REACH, 0.0, 0.0])))
    rough.reset(seed=1, options={"start": thrown})
    with pytest.raises(GslError, match=r"the edge of the uneven ground .* shorten task\.duration"):
        for _ in range(5):
            rough.step(np.full(len(rough.layout.joints), 0.2))
    plane = world({}).make()
    plane.reset(seed=1, options={"start": thrown})
    plane.step(np.full(len(rough.layout.joints), 0.2))
    plane.close()
