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


def load_own_effects(folder: Path | None, trust: Collection[str]) -> list[ConfigError]:
    """Have the effects of a user's folder stand beside the library's; without a folder, none.

    One of a module that is not trusted is withheld: only a command that names it fails.

    Returns:
        Why effects are withheld, one reason each.

    Raises:
        ConfigError: A file does not name an effect.
    """
    classes: dict[str, type] = {}
    refused: dict[str, ConfigError] = {}
    find_own_modules(trust)
    for path in sorted((folder / GROUP).glob("*.yaml")) if folder is not None else []:
        content, where = _read(path), f"{GROUP}/{path.name}"
        try:
            check_code(content, trust, where)
        except ConfigError as error:
            refused[path.stem] = error
        else:
            classes[path.stem] = class_of(content[TARGET], where)
    use_own(classes, refused)
    return list(refused.values())


def _read(path: Path) -> dict[str, str]:
    content = yaml_tree(path, read_text(path))
    if not isinstance(content, dict) or content.keys() != {TARGET}:
        problem = "has one line, `_target_: module.Class`; defaults stand in the class"
        raise ConfigError(f"{GROUP}/{path.name}", problem)
    return content
