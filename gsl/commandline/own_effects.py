"""Effects of a user's own: effect/NAME.yaml in his folder names the class, and the class declares all else."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from gsl.commandline.own_word import find_own_modules
from gsl.core.budget import read_text
from gsl.core.trust import TARGET, check_code, class_of
from gsl.core.yaml_tree import yaml_tree
from gsl.effects.effect import use_own
from gsl.errors import ConfigError

GROUP = "effect"


def load_own_effects(folder: Path | None, trust: Collection[str]) -> None:
    """Have the effects of a user's folder stand beside the library's; without a folder, none.

    Raises:
        ConfigError: A file does not name an effect, or one of a module that is not trusted.
    """
    files = sorted((folder / GROUP).glob("*.yaml")) if folder is not None else []
    find_own_modules(trust)
    use_own({path.stem: _named_class(path, trust) for path in files})


def _named_class(path: Path, trust: Collection[str]) -> type:
    where = f"{GROUP}/{path.name}"
    content = yaml_tree(path, read_text(path))
    if not isinstance(content, dict) or content.keys() != {TARGET}:
        raise ConfigError(where, "has one line, `_target_: module.Class`; defaults stand in the class")
    check_code(content, trust, where)
    kind: type = class_of(content[TARGET], where)
    return kind
