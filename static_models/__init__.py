"""The built-in models: `path(name)` of a model file, `names()` of them all.

And the cases, whose motion is known: `cases(name)`, `case_names()`; see `pgraph_core.verification`.
Installed, this folder is the package `pgraph_models`; from the repository root the name
`static_models` means the same module.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pgraph_core as pg
from pgraph_core.errors import InputError, Problem, choices

if TYPE_CHECKING:
    from pgraph_core.verification import Case

FOLDER = Path(__file__).parent
CASES = FOLDER / "cases"


def names() -> tuple[str, ...]:
    """Names of the built-in models, in alphabetical order."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.json")))


def path(name: str) -> Path:
    """The file of a built-in model. Raises InputError naming the ones there are."""
    if name not in names():
        text = f"no built-in model has this name; choose one of {choices(names(), 40)}"
        raise InputError(Problem(f"model '{name}'", "", text))
    return FOLDER / f"{name}.json"


def __getattr__(name: str) -> object:
    hint = "; write pg.Model.load(pgraph_models.path('pendulum'))" if name == "load" else ""
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'{hint}")


@cache
def about() -> dict[str, str]:
    """A sentence for each built-in model, by name."""
    from .build import BUILDERS

    return {name: (BUILDERS[name].__doc__ or "").split("\n")[0] for name in names()}


@cache
def _case_files() -> dict[str, Path]:
    """Name of a case -> its file."""
    found: dict[str, Path] = {}
    for file in sorted(CASES.glob("*.json")):
        data = json.loads(file.read_text(encoding="utf-8"))
        for entry in data["cases"]:
            variant = entry.get("variant")
            found[data["name"] if variant is None else f"{data['name']}_{variant}"] = file
    return found


def case_names(family: str | None = None) -> tuple[str, ...]:
    """Return the names of the cases, of one file if `family` names it, such as "chain_n_links"."""
    return tuple(
        name for name, file in _case_files().items() if family is None or file.stem == family
    )


def cases(name: str) -> tuple[Case, ...]:
    """The case of this name, or all of a file called so.

    Raises InputError naming the ones there are.
    """
    wanted = (name,) if name in _case_files() else case_names(name)
    if not wanted:
        families = dict.fromkeys(file.stem for file in _case_files().values())
        text = f"no case has this name; choose one of {choices(families, 40)}"
        raise InputError(Problem(f"case '{name}'", "", text))
    return tuple(case for case in pg.load_cases(_case_files()[wanted[0]]) if case.name in wanted)
