"""`gsl audit`, and what a diagnosis and an import do with wiring: as a user meets them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import done, gsl, refused

from gsl.effects.effect import names
from gsl.storage.trajectories import read, write

pytestmark = pytest.mark.slow

SIM = ("sim.robot=blind_arm.arm", "sim.floating=false")
PLAYED = (
    "world=nao_ideal", "world.robot=blind_arm.arm", "world.floating=false",
    "task=excite", "policy.duration=3.5", "workers=1",
    "policy.motions=[steps_large,triangle_fast,chirp]",
)  # fmt: skip
TRIED = sorted({*names()} - {"command_latency", "coulomb_friction"})  # left out where causes are not the question


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run `good`, a log `turned.parquet` whose elbow has the other sign, and `degrees.parquet`."""
    place = tmp_path_factory.mktemp("audit")
    done("collect", *PLAYED, "world.effects.encoder_noise.sd=0.0015", "name=good", folder=place)
    log = read(place / "runs/good/collect_real/trajectories.parquet")
    for name, factors in (("turned", np.array([1.0, -1.0])), ("degrees", np.array([57.3, 57.3]))):
        side = ("position",) if name == "turned" else ("position", "action")
        episodes = [
            replace(episode, **{key: factors * getattr(episode, key) for key in side}) for episode in log.episodes
        ]
        write(place / f"{name}.parquet", replace(log, episodes=tuple(episodes)))
    return place


def test_a_log_in_order_is_clean(folder: Path) -> None:
    document = json.loads(done("audit", "real=good", *SIM, "name=good", "--json", folder=folder).out)
    assert (document["verdict"], document["findings"]) == ("clean", [])


@pytest.mark.parametrize(("name", "sentence"), [
    ("turned", "The positions of elbow have the other sign."),
    ("degrees", "Commands and positions of all joints are in degrees, not in radians."),
])  # fmt: skip
def test_a_fault_is_a_plain_sentence(folder: Path, name: str, sentence: str) -> None:
    said = done("audit", f"real={name}.parquet", *SIM, f"name={name}", folder=folder)
    assert sentence in said.out and "Mend this first" in said.out


def test_a_diagnosis_ends_with_the_wiring_and_names_no_physics(folder: Path) -> None:
    said = done("diagnose", "real=turned.parquet", *SIM, "name=turned", folder=folder)
    assert "Wiring, before any physics" in said.out
    report = json.loads((folder / "runs/turned/diagnose/report.json").read_text())
    assert (report["verdict"], report["causes"], report["effects"]) == ("wiring", [], {})
    assert not (folder / "runs/turned/diagnose/world").exists()
    assert "have the other sign" in (folder / "runs/turned/diagnose/report.html").read_text()


def test_an_audit_of_another_robot_or_of_nothing_is_one_line(folder: Path) -> None:
    assert "another robot" in refused("audit", "real=good", "name=refused", folder=folder)
    assert "no such path" in refused("audit", "real=nothing", *SIM, "name=refused", folder=folder)


def test_an_import_says_what_it_sees_and_mends_what_it_is_asked_to(tmp_path: Path) -> None:
    time = 0.02 * np.arange(400)
    wave = 2.0 * np.sin(3.0 * time)
    wrapping, glitch = np.mod(wave, 2.0 * np.pi), 0.4 * np.sin(2.0 * time)
    glitch[100] += 0.5
    columns = {
        "time": time, "action.a": np.r_[wave[3:], wave[:3]], "action.b": np.roll(0.4 * np.sin(2.0 * time), -3),
        "position.a": wrapping, "position.b": glitch,
        "velocity.a": np.full(400, np.nan), "velocity.b": np.full(400, np.nan),
    }  # fmt: skip
    rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(rows))
    said = gsl("import", "source=log.csv", "--check", folder=tmp_path)
    assert said.code == 2
    assert "position.a" in said.out and "mapping.unwrap=true" in said.out
    assert "position.b, episode 0, row 100" in said.out
    done("import", "source=log.csv", "mapping.unwrap=true", "mapping.glitches=mend", "name=log", folder=tmp_path)
    (episode,) = read(tmp_path / "runs/log/import/trajectories.parquet").episodes
    assert np.ptp(episode.position[:, 0] - wave) < 1e-6
    assert np.abs(episode.position[:, 1] - 0.4 * np.sin(2.0 * time)).max() < 0.01
    assert np.abs(episode.velocity).max() < 10.0


@pytest.mark.parametrize("stage", ["audit", "diagnose"])
def test_the_same_log_gives_the_same_payload_again(stage: str, folder: Path) -> None:
    few = () if stage == "audit" else ("most=1", "duels=0", "nulls=0", f"without={TRIED}")
    done(stage, "real=good", *SIM, f"name=twice_{stage}", *few, folder=folder)
    assert "differs" not in done("rerun", f"twice_{stage}/{stage}", "trust=blind_arm", folder=folder).out
