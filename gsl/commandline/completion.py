"""Shell completion of overrides: names of settings and groups, and the options of a group."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import typer

CONFIG_DIR = "GSL_CONFIG_DIR"


def complete(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return what the word under the cursor may become."""
    typed, words_of_bash = incomplete, os.environ.get("COMP_WORDS")
    if words_of_bash:
        typed = join_words(words_of_bash.split("\n"), int(os.environ.get("COMP_CWORD", "0")))
    matches = suggestions(name_of(ctx), typed, config_dir=user_folder(ctx))
    cut = len(typed) - len(incomplete.lstrip("="))
    return [word[cut:] for word in matches]


def name_of(ctx: typer.Context) -> str:
    """Return the name of a stage's command, which may be of two words, without that of the program."""
    return ctx.command_path.partition(" ")[2]


def user_folder(ctx: typer.Context) -> Path | None:
    """Return the user's folder of yaml files; help and completion run before the options are all read."""
    folder = ctx.params.get("config_dir") or os.environ.get(CONFIG_DIR)
    return Path(folder) if folder else None


def join_words(words: Sequence[str], cursor: int) -> str:
    """Return the whole word at the cursor: bash splits `world=nao` into three."""
    before = [word for word in words[: cursor + 1]]
    while len(before) > 1 and ("=" in (before[-1][:1], before[-2][-1:])) and " " not in before[-2]:
        before[-2:] = [before[-2] + before[-1]]
    return before[-1] if before else ""


def suggestions(command: str, typed: str, *, config_dir: Path | None = None) -> list[str]:
    """Return the overrides of a command that begin with what was typed."""
    from gsl.commandline.help import explain

    explanation = explain(command, config_dir=config_dir)
    key = typed.partition("=")[0]
    if "=" in typed:
        words = [f"{key}={name}" for name in explanation.options.get(key, ())]
    else:
        words = [f"{group}={name}" for group, names in explanation.options.items() for name in names]
        # a key alone and with its value: two words, so that the shell goes on without a blank
        words += [word for key, value in explanation.defaults.items() for word in (f"{key}=", f"{key}={value}")]
    return [word for word in words if word.startswith(typed)]
