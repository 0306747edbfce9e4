"""The built-in models: `path(name)` of a model file, `names()` of them all."""

from __future__ import annotations

from pathlib import Path

from pgraph_core.errors import InputError, Problem, choices

FOLDER = Path(__file__).parent


def names() -> tuple[str, ...]:
    """Names of the built-in models, in alphabetical order."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.json")))


def path(name: str) -> Path:
    """The file of a built-in model. Raises InputError naming the ones there are."""
    if name not in names():
        text = f"no built-in model has this name; choose one of {choices(names())}"
        raise InputError(Problem(f"model '{name}'", "", text))
    return FOLDER / f"{name}.json"
