"""The numbers of a model that a search may change, and the curves that its runs have."""

from __future__ import annotations

from functools import lru_cache

import pgraph_core as pg
from pgraph_core.result.columns import columns_of
from pgraph_core.simulation.paths import Path

PLACES = [(field, axis) for field in ("com", "link") for axis in range(3)]
OF_BODY: list[tuple[str | int, ...]] = [("mass",), ("damping",), ("stiffness",), *PLACES]


@lru_cache(maxsize=4)
def numbers_of(model: pg.Model) -> dict[str, float]:
    """Return numbers by path: parameters, bodies' and forces' fields, and initial coordinates."""
    found = dict[str, float]()
    for path, words in _paths(model).items():
        try:
            value = Path(model, words).present
        except pg.PgraphError:
            continue
        if value == value and (value or path.startswith("q.")):  # zero values have no effect
            found[path] = value
    return found


def _paths(model: pg.Model) -> dict[str, str | tuple[str | int, ...]]:
    paths: dict[str, str | tuple[str | int, ...]] = {name: name for name in model.parameters}
    for body in model.bodies:
        paths[f"q.{body.name}"] = ("bodies", body.name, "q")
        for field, *entry in OF_BODY:
            words = ("bodies", body.name, field, *entry)
            paths[".".join(map(str, words))] = words
    for force in model.forces:
        for field, facts in type(force).model_fields.items():
            if "float" in str(facts.annotation):
                paths[f"forces.{force.name}.{field}"] = ("forces", force.name, field)
    return paths


@lru_cache(maxsize=4)
def units_of(model: pg.Model) -> dict[str, str]:
    """Return the SI units of `numbers_of`."""
    paths = _paths(model)
    return {path: Path(model, paths[path]).unit(model) for path in numbers_of(model)}


@lru_cache(maxsize=4)
def signals_of(model: pg.Model) -> tuple[str, ...]:
    """Return the names of the columns of the model's runs."""
    if not model.bodies:
        return ()
    try:
        run = pg.simulate(model, t_end=1e-6, frames=2, estimate=False)
    except pg.PgraphError:
        return ()
    return tuple(name for name, column in columns_of(run).items() if name != "t" and column.unit)
