"""Effects of a user's own: effect/NAME.yaml in his folder names the class, and the class declares all else."""

from __future__ import annotations

from pathlib import Path

import yaml

from gsl.core.described import class_of
from gsl.effects.effect import use_own
from gsl.errors import ConfigError

GROUP = "effect"


def load_own_effects(folder: Path | None) -> None:
    """Have the effects of a user's folder stand beside the library's; without a folder, none.

    Raises:
        ConfigError: A file does not name an effect.
    """
    files = sorted((folder / GROUP).glob("*.yaml")) if folder is not None else []
    use_own({path.stem: _named_class(path) for path in files})


def _named_class(path: Path) -> type:
    where = f"{GROUP}/{path.name}"
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(where, "cannot be read as yaml") from error
    if not isinstance(content, dict) or content.keys() != {"_target_"}:
        raise ConfigError(where, "has one line, `_target_: module.Class`; defaults stand in the class")
    kind: type = class_of(content["_target_"], trust=True, where=where)
    return kind
