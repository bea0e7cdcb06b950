"""Make a blind benchmark: logs of robots with known causes, and labels that are sealed and kept elsewhere."""

from __future__ import annotations

import pickle
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from gsl.core.console import Console
from gsl.core.described import describe
from gsl.core.setting import component, setting
from gsl.errors import GslError
from gsl.policies.excitation import Excitation
from gsl.rollout.parallel import Workers, in_parallel
from gsl.storage import documents
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.velocity_motors import check_servos
from gsl_benchmarks.blind.files import CASES, LABELS, SEALS, SECRET, write_case
from gsl_benchmarks.blind.label import WALK
from gsl_benchmarks.blind.make import Workshop, rng_of
from gsl_benchmarks.blind.mix import Mix, Slot, slots, walk_slots
from gsl_benchmarks.blind.on_foot import Track
from gsl_benchmarks.blind.programmes import draw_programmes
from gsl_benchmarks.blind.seals import VERSION, files_below, hash_label, nonce_of
from gsl_benchmarks.blind.walks import Walks


class _Order(NamedTuple):
    """A case to make: its name, what it has to be, secret and seed of its draws, and its folder."""

    name: str
    slot: Slot
    secret: str
    seed: int
    folder: Path


@component
class BlindMake:
    """Draws robots of one make with no, one or two causes, lets each play a programme, and seals what it has.

    The draws depend on the seed and on a secret that lies with the labels: the data alone do not allow to draw again.
    """

    kind: ClassVar[str] = "blind_make"

    sim: Annotated[BulletWorld, setting("the simulator that all robots are nominally alike to")]
    excitation: Annotated[Excitation, setting("what the robots play; programmes are variations of it")]
    labels: Annotated[str, setting("folder of the labels and of the secret, not below out", min_length=1)]
    mix: Annotated[Mix, setting("kinds of cases, in proportion")]
    walks: Annotated[Walks, setting("what robots log on the ground")]
    cases: Annotated[int, setting("how many there are in the air", ge=0, le=9999)] = 240
    programmes: Annotated[int, setting("sets of commands that they share", ge=1)] = 4
    workers: Workers = -1
    seed: Annotated[int, setting("of all randomness, together with the secret", ge=0)] = 1

    def __post_init__(self) -> None:
        """Refuse a benchmark without a case, or of a simulator that logs cannot be replayed in."""
        check_servos(self.sim.motors)
        if not self.cases + self.mix.walk:
            raise ValueError("needs at least one case, in the air or on the ground")

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the cases and their seals into the folder, and the labels into another one."""
        secret = self._secret(folder)
        world, orders = self.sim, self._orders(folder, secret)
        drawn = draw_programmes(self.excitation, self.programmes, world.period, rng_of(secret, self.seed, "programmes"))
        workshop = Workshop(world.plant, world.step, world.period, tuple(drawn))
        shared = (
            workshop,
            Track(world, self.walks),
            {key: value for key, value in describe(world).items() if key != "_target_"},
        )
        with console.progress(len(orders), "making cases") as progress:
            made = in_parallel(_make, shared, orders, self.workers, progress)
        labels = {order.name: label for order, label in zip(orders, made, strict=True)}
        nonces = {name: nonce_of(secret, name) for name in labels}
        seals = {
            name: {"label": hash_label(nonces[name], label), "files": files_below(folder / CASES / name)}
            for name, label in labels.items()
        }
        documents.write_json(folder / SEALS, {"schema_version": VERSION, "cases": seals})
        self._keep({name: {"nonce": nonces[name], "label": label} for name, label in labels.items()})
        return {
            "cases": len(labels),
            "references": sum("reference.parquet" in seal["files"] for seal in seals.values()),
        }

    def _orders(self, folder: Path, secret: str) -> list[_Order]:
        wanted = slots(self.mix, self.cases, self.programmes, rng_of(secret, self.seed, "slots"))
        wanted += walk_slots(self.mix, rng_of(secret, self.seed, "walks"))
        names = [f"case_{index + 1:04d}" for index in range(len(wanted))]
        return [
            _Order(name, slot, secret, self.seed, folder / CASES / name)
            for name, slot in zip(names, wanted, strict=True)
        ]

    def _secret(self, folder: Path) -> str:
        """Return the secret of the labels' folder, drawn now if there is none."""
        place, home = Path(self.labels).resolve(), folder.parent.resolve()
        parts = place.relative_to(home).parts if place.is_relative_to(home) else ()
        if len(parts) > 1 and folder.name.startswith(f".{parts[0]}."):
            raise GslError(f"labels={self.labels}: lies below out, where whoever answers would read it")
        kept = place / SECRET
        if not kept.exists():
            place.mkdir(parents=True, exist_ok=True)
            kept.write_text(secrets.token_hex(16) + "\n", encoding="utf-8")
        return kept.read_text(encoding="utf-8").strip()

    def _keep(self, labels: Mapping[str, Any]) -> None:
        """Write the labels; those of another benchmark stay."""
        path, text = Path(self.labels) / LABELS, documents.text({"schema_version": VERSION, "cases": labels}, indent=2)
        if path.exists() and path.read_text(encoding="utf-8").strip() != text:
            raise GslError(f"{path}: holds the labels of another benchmark; choose another labels=")
        documents.write_json(path, {"schema_version": VERSION, "cases": labels})


def _make(frozen: bytes, order: _Order) -> dict[str, Any]:
    """Make and write one case; return its label."""
    workshop, track, world = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    place = track if order.slot.kind == WALK else workshop
    case = place.case(order.name, order.slot, rng_of(order.secret, order.seed, order.name))
    handed_out = {"sim": world, "without": list(case.label.without)}
    write_case(order.folder, case.log, case.reference, handed_out)
    return dict(documents.plain(case.label.document))
