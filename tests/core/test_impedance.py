"""The maths of compliance against a simulated mass on a spring, and the laws of shares."""

import numpy as np
import pytest

from gsl.core.impedance import compute_closure, compute_transfer, impedance

STEP, FREQUENCY = 1e-4, 1.25
OMEGA = 2.0 * np.pi * FREQUENCY


def swung(stiffness: float, damping: float, inertia: float, drift: float = 0.0) -> complex:
    """Impedance of a mass on a spring that is integrated in time."""
    times, motion, rows = STEP * np.arange(40000), np.zeros(2), []
    load = 0.8 * np.sin(OMEGA * times)
    for torque in load:
        rows.append(motion[0])
        motion[1] += STEP * (torque - stiffness * motion[0] - damping * motion[1]) / inertia
        motion[0] += STEP * motion[1]
    settled, offset = times >= 0.8, 0.3 + drift * times
    deflection = (np.array(rows) + offset)[settled, None]
    return complex(impedance(load[settled, None], deflection, times[settled], FREQUENCY)[0])


@pytest.mark.parametrize(("stiffness", "damping", "inertia"), [(150.0, 4.0, 0.02), (40.0, 0.5, 0.1)])
def test_a_mass_on_a_spring_has_the_textbooks_impedance(stiffness: float, damping: float, inertia: float) -> None:
    assert swung(stiffness, damping, inertia) == pytest.approx(
        stiffness - inertia * OMEGA**2 + 1j * OMEGA * damping, rel=2e-3
    )


def test_an_offset_and_a_drift_are_no_compliance() -> None:
    assert swung(60.0, 1.0, 0.02, drift=0.05) == pytest.approx(swung(60.0, 1.0, 0.02), rel=1e-6)


def test_what_does_not_move_is_infinitely_stiff() -> None:
    times = STEP * np.arange(8000)
    load = np.sin(OMEGA * times)[:, None]
    assert np.isinf(impedance(load, np.zeros((8000, 1)), times, FREQUENCY)).all()


SIM, REAL = np.array([150.0, 150.0, 50.0]), np.array([75.0, 90.0, 60.0])  # the third joint is stiffer in real
NOISE = np.full(3, 1.0)


@pytest.mark.parametrize("share", [compute_transfer, compute_closure])
@pytest.mark.parametrize("way", [0.0, 0.3, 1.0])
def test_a_grounding_that_goes_a_part_of_the_way_at_every_joint_has_that_share(share, way: float) -> None:
    assert share(SIM, SIM + way * (REAL - SIM), REAL, NOISE) == pytest.approx(way)


def test_joints_that_do_not_differ_do_not_count() -> None:
    real = REAL.copy()
    real[1] = SIM[1] - 0.5
    grounded = np.array([75.0, 0.0, 60.0])
    assert compute_transfer(SIM, grounded, real, NOISE) == pytest.approx(1.0)
    assert compute_transfer(SIM, grounded, SIM, NOISE) is None
    assert compute_closure(SIM, grounded, SIM, NOISE) is None


def test_what_goes_too_far_at_one_joint_closes_no_gap_at_another() -> None:
    sim, real, grounded = np.array([100.0, 100.0]), np.array([50.0, 50.0]), np.array([0.0, 100.0])
    assert compute_transfer(sim, grounded, real, NOISE[:2]) == pytest.approx(1.0)
    assert compute_closure(sim, grounded, real, NOISE[:2]) == pytest.approx(0.0)


def test_the_wrong_phase_is_a_gap() -> None:
    sim, real = np.array([150.0 + 30j]), np.array([75.0 + 30j])
    assert compute_closure(sim, np.array([75.0 - 45j]), real, NOISE[:1]) == pytest.approx(0.0)
