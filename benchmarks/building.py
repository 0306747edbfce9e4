"""From a description to something that can be asked, and after one edit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.model import files
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio

from .machine import has
from .scenes import STEP, Scene, bare, differ, quadruped, scene
from .timing import Case

PAW, PARENTS = "left_hind_paw", ("left_femur", "left_tibia")


def from_columns(place: Scene, *, goal: float, small: bool) -> Case:
    """Arrays in memory to a Mechanism; the peers build their models from the same numbers."""
    arrays = arrays_of(place.model)

    def ours() -> pg.Mechanism:
        return pg.Mechanism(pg.Columns(**arrays))

    q, v = place.state.q, place.state.v
    found, expected = ours(), pg.Mechanism(place.model)
    agreement = differ(found.bias_force(q, v), expected.bias_force(q, v), 1e-12, "columns")
    return Case(
        f"columns to Mechanism, {place.name}",
        {"pgraph": ours} | builders(place, small=small),
        "model",
        agreement=f"from the model {agreement}",
        goals={"MjSpec + compile": goal},
    )


def arrays_of(model: pg.Model) -> dict[str, Any]:
    """The numbers and names of a model of one motion a joint, as columns."""
    bodies, rows = model.bodies, {"ground": 0, **{n: i + 1 for n, i in model.row.items()}}
    fields = ("link", "rotation", "mass", "com", "inertia")
    columns = {field: np.array([getattr(b, field) for b in bodies], float) for field in fields}
    return {
        "parent": np.array([rows[b.parent] for b in bodies]),
        "joint": np.array([pg.Columns.JOINTS.index(b.joint) for b in bodies]),
        "axis": np.array([axis for b in bodies for _, axis in b.motions], float),
        "q": np.array([x for b in bodies for x in b.q]),
        "names": [b.name for b in bodies],
        "gravity": np.array(model.gravity),
        **columns,
    }


def construction(place: Scene, *, goal: float, small: bool) -> Case:
    """A validated Model, new every time, to a Mechanism; the peers start at arrays in memory."""
    text = place.model.to_json()

    def ours() -> float:
        model = pg.Model.from_json(text)
        begin = time.perf_counter()
        pg.Mechanism(model)
        return time.perf_counter() - begin

    return Case(
        f"Model to Mechanism, {place.name}",
        {"pgraph": ours} | builders(place, small=small),
        "model",
        goals={"MjSpec + compile": goal},
        clocked=frozenset({"pgraph"}),
    )


def from_text(place: Scene) -> Case:
    """The text of a file to something that runs: reading and validation included."""
    text = place.model.to_json()
    data = {k: v for k, v in files.parse(text, "bench").items() if k[0] != "$"}
    sides: dict[str, Callable[[], Any]] = {
        "pgraph": lambda: pg.Mechanism(pg.Model.from_json(text)),
        "pgraph, validation alone": lambda: pg.Model(**data),
    }
    if has("mujoco"):
        import mujoco

        spec = spec_builder(place)()
        spec.compile()
        theirs = spec.to_xml()
        sides["MjModel.from_xml_string"] = lambda: mujoco.MjModel.from_xml_string(theirs)
    return Case(f"text to Mechanism, {place.name}", sides, "model")


def spec_builder(place: Scene) -> Callable[[], Any]:
    """A function that builds MuJoCo's spec of a scene."""
    return in_mujoco.spec_builder(place.rows, place.model.gravity, STEP, "semi_implicit_euler")


def builders(place: Scene, *, small: bool) -> dict[str, Callable[[], object]]:
    """MjSpec filled and compiled, Drake's plant; for small models also with MjData and pin.Data."""
    found: dict[str, Callable[[], object]] = {}
    if has("mujoco"):
        import mujoco

        spec = spec_builder(place)
        found["MjSpec + compile"] = lambda: spec().compile()
        if small:
            found["MjSpec + compile + MjData"] = lambda: mujoco.MjData(spec().compile())
    if has("pin") and small:  # its data is cubic in memory
        found["pin.Model + Data"] = in_pinocchio.builder(place)
    if has("drake"):
        found["MultibodyPlant + context"] = lambda: in_drake.build(place)[0].CreateDefaultContext()
    return found


def parent_changed() -> Case:
    """One body of the quadruped hung elsewhere and back: two edits a call.

    Ours edits a mechanism, or a model; MuJoCo compiles a spec in which the body hangs there
    already, Pinocchio builds from its rows: neither edits what it has built.
    """
    model = bare(quadruped()).edit(PAW, parent=PARENTS[0])
    mech = pg.Mechanism(model)
    there, back = PARENTS[1], PARENTS[0]
    places = [scene("", model.edit(PAW, parent=parent)) for parent in PARENTS]

    def ours() -> pg.Mechanism:
        return mech.edit(PAW, parent=there).edit(PAW, parent=back)

    def looked_at() -> None:
        now = mech
        for parent in (there, back):
            now = now.edit(PAW, parent=parent)
            _ = now.pgraph, now.jdof, now.mass_matrix(now.home()[0])

    def by_model() -> None:
        now = model
        for parent in (there, back):
            now = now.edit(PAW, parent=parent)
            pg.Mechanism(now)

    looked_at()  # what it compiles shall not pass for a long call
    sides: dict[str, Callable[[], Any]] = {
        "pgraph, mech.edit": ours,
        "pgraph, mech.edit, Pgraph, jdof and M": looked_at,
        "pgraph, model.edit and Mechanism": by_model,
    }
    q, v = places[1].state.q, places[1].state.v
    expected = pg.Mechanism(places[1].model).bias_force(q, v)
    agreement = differ(mech.edit(PAW, parent=there).bias_force(q, v), expected, 1e-15, "edit")
    return Case(
        "parent changed, quadruped",
        sides | recompiled(places),
        "edit",
        per_call=2,
        agreement=f"rebuilt {agreement}",
        goals={"compile + MjData": 200.0},
    )


def recompiled(places: list[Scene]) -> dict[str, Callable[[], Any]]:
    """The peers' models, rebuilt from prepared specs or rows, one after the other."""
    sides: dict[str, Callable[[], Any]] = {}
    if has("mujoco"):
        import mujoco

        specs = [spec_builder(place)() for place in places]
        sides["compile + MjData"] = lambda: [mujoco.MjData(spec.compile()) for spec in specs]
    if has("pin"):
        built = [in_pinocchio.builder(place) for place in places]
        sides["pin.Model + Data"] = lambda: [build() for build in built]
    return sides


def mass_changed() -> Case:
    """Another mass of one body of the quadruped; MuJoCo's own way is mj_setConst."""
    model = bare(quadruped())
    mech = pg.Mechanism(model)
    turns = iter(range(10**12))

    def mass() -> float:
        return 0.4 + 0.1 * (next(turns) % 2)

    sides: dict[str, Callable[[], Any]] = {
        "pgraph, mech.edit": lambda: mech.edit(PAW, mass=0.5 + mass()),
        "pgraph, model.edit and Mechanism": lambda: pg.Mechanism(model.edit(PAW, mass=0.5)),
    }
    if has("mujoco"):
        import mujoco

        compiled = spec_builder(scene("", model))().compile()
        data, body = mujoco.MjData(compiled), compiled.body(PAW).id

        def set_const() -> None:
            compiled.body_mass[body] = mass()
            mujoco.mj_setConst(compiled, data)

        sides["body_mass + mj_setConst"] = set_const
    return Case("mass changed, quadruped", sides, "edit")
