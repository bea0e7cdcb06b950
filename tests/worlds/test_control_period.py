"""A control period, compiled and in Python."""

from pathlib import Path

import numpy as np
import pytest
from learned_servos import lawful, some_law

from gsl.core.plant import nominal
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.bullet_c import NO_HANDLE, client_handle
from gsl.worlds.engine import Engine
from gsl.worlds.physics import Physics
from gsl.worlds.start import resting


def moved(engine: Engine, handle: int, *, loaded: bool = False) -> np.ndarray:
    """Sensor values of some control periods with random targets, and random loads on the joints."""
    robot, rng = engine.robot, np.random.default_rng(0)
    stance = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    start = resting(robot, stance, stance, floating=engine.physics.floating)
    engine.handle = handle
    engine.load(start.reading, start.commands)
    seen = []
    for _ in range(40):
        targets = stance + 0.1 * rng.standard_normal(len(stance))
        engine.run(targets, 0.3 * rng.standard_normal((10, len(stance))) if loaded else None)
        reading = engine.read()
        seen.append(np.r_[reading.motion.ravel(), reading.place, reading.quaternion, reading.velocity, reading.gyro])
    return np.array(seen)


@pytest.mark.parametrize("learned", [False, True])
@pytest.mark.parametrize("floating", [True, False])
def test_compiled_and_python_agree_to_the_bit(floating: bool, learned: bool) -> None:
    plant = nominal(nao())
    engine = Engine(lawful(plant, some_law(plant)) if learned else plant, Physics(0.002, 50, 0.02, floating=floating))
    if engine.handle == NO_HANDLE:
        pytest.skip("this build of pybullet does not tell where its clients are")
    compiled = moved(engine, engine.handle)
    in_python = moved(engine, NO_HANDLE)
    engine.close()
    np.testing.assert_array_equal(compiled, in_python)


@pytest.mark.parametrize("floating", [True, False])
def test_torque_noise_is_the_same_to_the_bit_in_both(floating: bool) -> None:
    plant = apply_all(nominal(nao()), build({"torque_noise": {"step": 0.3, "constant": 0.1}}))
    engine = Engine(plant, Physics(0.002, 50, 0.02, floating=floating))
    if engine.handle == NO_HANDLE:
        pytest.skip("this build of pybullet does not tell where its clients are")
    handle = engine.handle
    compiled, in_python = moved(engine, handle, loaded=True), moved(engine, NO_HANDLE, loaded=True)
    quiet = moved(engine, handle)
    engine.close()
    np.testing.assert_array_equal(compiled, in_python)
    assert np.abs(compiled - quiet).max() > 1e-3


def test_a_file_that_is_no_library_gives_no_handle(tmp_path: Path) -> None:
    path = tmp_path / "module.so"
    path.write_bytes(b"not an ELF file" * 10)
    assert client_handle(str(path), 0) == NO_HANDLE
