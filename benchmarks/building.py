"""From a description to something that can be asked, and after one edit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import has
from .scenes import Scene, bare, quadruped, scene
from .timing import Case


def construction(place: Scene, *, goal: float, small: bool) -> Case:
    """A validated Model to a Mechanism; the peers build theirs from numbers that are at hand.

    `first` packs a model that is new, `again` one whose rows keep their packed form.
    """
    text = place.model.to_json()

    def first() -> float:
        model = pg.Model.from_json(text)
        begin = time.perf_counter()
        pg.Mechanism(model)
        return time.perf_counter() - begin

    sides = {"pgraph, first": first, "pgraph, again": lambda: pg.Mechanism(place.model)}
    return Case(
        f"Model to Mechanism, {place.name}",
        sides | builders(place, small=small),
        "model",
        goals={"MjSpec + compile": goal},
        clocked=frozenset({"pgraph, first"}),
    )


def builders(place: Scene, *, small: bool) -> dict[str, Callable[[], object]]:
    """MjSpec filled and compiled, Drake's plant; of what is small also with Mj- and pin.Data."""
    found: dict[str, Callable[[], object]] = {}
    if has("mujoco"):
        import mujoco

        from . import in_mujoco

        spec = in_mujoco.spec_builder(place)
        found["MjSpec + compile"] = lambda: spec().compile()
        if small:
            found["MjSpec + compile + MjData"] = lambda: mujoco.MjData(spec().compile())
    if has("pin") and small:  # its data is cubic in memory
        from . import in_pinocchio

        found["pin.Model + Data"] = in_pinocchio.builder(place)
    if has("drake"):
        from . import in_drake

        found["MultibodyPlant + context"] = lambda: in_drake.build(place)[0].CreateDefaultContext()
    return found


def one_edit() -> Case:
    """One body of the quadruped hung elsewhere.

    Ours goes from `edit` of the validated model to Pgraph, jdof and the mass matrix; MuJoCo
    compiles a spec in which the body hangs there already, Pinocchio builds from its rows.
    """
    model = bare(quadruped())
    parents = ("left_femur", "left_tibia")
    places = [scene("", model.edit("left_hind_paw", parent=parent)) for parent in parents]
    turns = iter(range(10**9))

    def ours() -> tuple[np.ndarray, ...]:
        mech = pg.Mechanism(model.edit("left_hind_paw", parent=parents[next(turns) % 2]))
        return mech.pgraph, mech.jdof, mech.mass_matrix(mech.home()[0])

    sides: dict[str, Callable[[], Any]] = {"pgraph": ours}
    if has("mujoco"):
        import mujoco

        from . import in_mujoco

        specs = [in_mujoco.spec_builder(place)() for place in places]
        sides["compile + MjData"] = lambda: mujoco.MjData(specs[next(turns) % 2].compile())
    if has("pin"):
        from . import in_pinocchio

        built = [in_pinocchio.builder(place) for place in places]
        sides["pin.Model + Data"] = lambda: built[next(turns) % 2]()
    return Case("parent changed, quadruped", sides, "edit", goals={"compile + MjData": 200.0})
