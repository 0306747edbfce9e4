"""From a description to a mechanism, and after one edit, against MuJoCo, Pinocchio and Drake."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pgraph_core as pg
from pgraph_core.model import files
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio

from .machine import has
from .measure import Effort, Row, compared, differ
from .scenes import STEP, Scene, scene, tree_of_quadruped

MINUTES = 5.0
PEERS = ("mujoco", "pin", "drake")
PAW, PARENTS = "left_hind_paw", ("left_femur", "left_tibia")

Calls = dict[str, Callable[[], Any]]


def rows(effort: Effort) -> Iterator[Row]:
    quadruped = tree_of_quadruped()
    yield from from_model(effort, quadruped)
    yield from from_text(effort, quadruped)
    n = effort.pick(1000, 20)
    chain = scene(f"chain of {n}", pg.Model.serial(n), 0.2)
    yield from from_model(effort, chain)
    yield from parent_changed(effort, quadruped.model)
    yield from mass_changed(effort, quadruped.model)
    if has("mujoco"):
        yield from many_geoms(effort)


def many_geoms(effort: Effort) -> Iterator[Row]:
    """An MJCF file with many boxes in the world, read as a Model; MuJoCo reads and compiles it."""
    mujoco = import_module("mujoco")

    count = effort.pick(3000, 100)
    box = '<geom type="box" size=".1 .1 .1" pos="{} 0 0"/>'
    boxes = "".join(box.format(k) for k in range(count))
    ball = '<body pos="0 0 1"><freejoint/><geom size=".1" mass="1"/></body>'
    with TemporaryDirectory() as folder:
        path = Path(folder, "boxes.xml")
        path.write_text(f"<mujoco><worldbody>{boxes}{ball}</worldbody></mujoco>", encoding="utf-8")
        sides: Calls = {
            "pgraph, read_mjcf": lambda: pg.read_mjcf(path),
            "MjModel.from_xml_path": lambda: mujoco.MjModel.from_xml_path(str(path)),
        }
        yield from compared(effort, f"MJCF file of {count} boxes", sides, unit="file")

        def first() -> pg.Result:
            return pg.simulate(pg.read_mjcf(path)[0], t_end=STEP, step=STEP, frames=2)

        def theirs() -> None:
            model = mujoco.MjModel.from_xml_path(str(path))
            mujoco.mj_step(model, mujoco.MjData(model))

        sides = {"pgraph": first, "mujoco": theirs}
        case = f"file of {count} boxes to its first step"
        yield from compared(effort, case, sides, unit="file", rounds=effort.pick(5, 2))


def from_model(effort: Effort, place: Scene) -> Iterator[Row]:
    """A validated Model, new every time, to a Mechanism; the peers start at arrays in memory."""
    text = place.model.to_json()

    def ours() -> float:
        model = pg.Model.from_json(text)
        begin = time.process_time()
        pg.Mechanism(model)
        return time.process_time() - begin

    sides = {"pgraph": ours, **builders(place)}
    name = f"Model to Mechanism, {place.name}"
    return compared(effort, name, sides, unit="model", clocked={"pgraph"})


def from_text(effort: Effort, place: Scene) -> Iterator[Row]:
    """The text of a file to something that runs, reading and validation included."""
    text = place.model.to_json()
    data = {k: v for k, v in files.parse(text, "bench").items() if k[0] != "$"}
    sides: Calls = {
        "pgraph": lambda: pg.Mechanism(pg.Model.from_json(text)),
        "pgraph, validation alone": lambda: pg.Model(**data),
    }
    if has("mujoco"):
        mujoco = import_module("mujoco")

        spec = spec_builder(place)()
        spec.compile()
        theirs = spec.to_xml()
        sides["MjModel.from_xml_string"] = lambda: mujoco.MjModel.from_xml_string(theirs)
    return compared(effort, f"text to Mechanism, {place.name}", sides, unit="model")


def spec_builder(place: Scene) -> Callable[[], Any]:
    """A function that builds MuJoCo's spec of a scene."""
    return in_mujoco.spec_builder(place.rows, place.model.gravity, STEP, "semi_implicit_euler")


def builders(place: Scene) -> Calls:
    """MjSpec filled and compiled, Drake's plant; of small models also MjData and pin.Data."""
    found: Calls = {}
    small = len(place.model.bodies) < 100
    if has("mujoco"):
        mujoco = import_module("mujoco")

        spec = spec_builder(place)
        found["MjSpec + compile"] = lambda: spec().compile()
        if small:
            found["MjSpec + compile + MjData"] = lambda: mujoco.MjData(spec().compile())
    if has("pin") and small:  # its data is cubic in memory
        found["pin.Model + Data"] = in_pinocchio.builder(place)
    if has("drake"):
        found["MultibodyPlant + context"] = lambda: in_drake.build(place)[0].CreateDefaultContext()
    return found


def parent_changed(effort: Effort, plain: pg.Model) -> Iterator[Row]:
    """One body of the quadruped hung elsewhere and back.

    MuJoCo compiles a spec in which the body hangs there already, Pinocchio builds from its rows:
    neither edits what it has built.
    """
    model = plain.edit(PAW, parent=PARENTS[0])
    mech = pg.Mechanism(model)
    back, there = PARENTS
    places = [scene("", model.edit(PAW, parent=parent)) for parent in PARENTS]

    def ours() -> pg.Mechanism:
        return mech.edit(PAW, parent=there).edit(PAW, parent=back)

    def with_matrices() -> None:
        now = mech
        for parent in (there, back):
            now = now.edit(PAW, parent=parent)
            _ = now.pgraph, now.jdof, now.mass_matrix(now.home()[0])

    def by_model() -> None:
        now = model
        for parent in (there, back):
            now = now.edit(PAW, parent=parent)
            pg.Mechanism(now)

    with_matrices()  # compiles, so that it does not pass for a long call
    sides: Calls = {
        "pgraph, mech.edit": ours,
        "pgraph, mech.edit, Pgraph, jdof and M": with_matrices,
        "pgraph, model.edit and Mechanism": by_model,
    }
    if has("mujoco"):
        mujoco = import_module("mujoco")

        specs = [spec_builder(place)() for place in places]
        sides["compile + MjData"] = lambda: [mujoco.MjData(spec.compile()) for spec in specs]
    if has("pin"):
        built = [in_pinocchio.builder(place) for place in places]
        sides["pin.Model + Data"] = lambda: [build() for build in built]
    q, v = places[1].state.q, places[1].state.v
    expected = pg.Mechanism(places[1].model).bias_force(q, v)
    error = differ(mech.edit(PAW, parent=there).bias_force(q, v), expected, 1e-15, "edit")
    given = {"unit": "edit", "per_call": 2, "agrees": f"rebuilt {error}"}
    return compared(effort, "parent changed, quadruped", sides, **given)


def mass_changed(effort: Effort, model: pg.Model) -> Iterator[Row]:
    """Another mass of one body of the quadruped; MuJoCo's own way is mj_setConst."""
    mech, turns = pg.Mechanism(model), iter(range(10**12))

    def mass() -> float:
        return 0.4 + 0.1 * (next(turns) % 2)

    sides: Calls = {
        "pgraph, mech.edit": lambda: mech.edit(PAW, mass=0.5 + mass()),
        "pgraph, model.edit and Mechanism": lambda: pg.Mechanism(model.edit(PAW, mass=0.5)),
    }
    if has("mujoco"):
        mujoco = import_module("mujoco")

        compiled = spec_builder(scene("", model))().compile()
        data, body = mujoco.MjData(compiled), compiled.body(PAW).id

        def set_const() -> None:
            compiled.body_mass[body] = mass()
            mujoco.mj_setConst(compiled, data)

        sides["body_mass + mj_setConst"] = set_const
    return compared(effort, "mass changed, quadruped", sides, unit="edit")
