"""Public objects pickle and copy after any use, also between processes, with the same answers."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core import portable

COPIES = {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "deepcopy": copy.deepcopy}
COPIES["copy"] = copy.copy


def used(name: str) -> pg.Mechanism:
    """A mechanism of which everything has been asked once."""
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    q, v = mech.home()
    mech.constrained_dynamics(q, v)
    mech.energy(q, v)
    mech.mobility()
    mech.assemble()
    pg.simulate(mech, t_end=0.01)
    return mech


def answers(mech: pg.Mechanism) -> list[Any]:
    """Numbers of every kind that a mechanism gives."""
    q, v = mech.home()
    v = v + 0.1
    vdot, forces = mech.constrained_dynamics(q, v)
    run = pg.simulate(mech, t_end=0.02, frames=5)
    return [mech.mass_matrix(q), mech.forward_dynamics(q, v), vdot, *forces.values(), run.q, run.v]


def same(a: list[Any], b: list[Any]) -> bool:
    return len(a) == len(b) and all(map(np.array_equal, a, b))


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", ["four_bar", "quadruped", "double_pendulum"])
def test_a_used_mechanism_travels_with_equal_bits(name: str, how: str) -> None:
    mech = used(name)
    sent = COPIES[how](mech)
    assert sent.model == mech.model
    assert sent.names == mech.names
    assert same(answers(sent), answers(mech))


def test_an_edited_mechanism_travels_with_equal_bits() -> None:
    mech = used("double_pendulum")
    name = mech.names[-1]
    mech = mech.edit(name, mass=2.5).edit(name, link=(0.3, 0.1, 0.0))
    sent = pickle.loads(pickle.dumps(mech))
    assert sent.model == mech.model
    assert same(answers(sent), answers(mech))
    assert same(answers(sent.edit(name, mass=1.0)), answers(mech.edit(name, mass=1.0)))


def test_a_copy_has_its_own_workspace() -> None:
    mech = used("four_bar")
    sent = copy.copy(mech)
    assert not any(np.shares_memory(x, y) for x in arrays_of(mech) for y in arrays_of(sent))


def arrays_of(mech: pg.Mechanism) -> list[Any]:
    return [x for name, x in vars(mech).items() if isinstance(x, np.ndarray) and "work" in name]


def in_another_process(mech: pg.Mechanism) -> tuple[pg.Mechanism, list[Any], pg.Result]:
    return mech, answers(mech), pg.simulate(mech, t_end=0.05)


def fails_in_another_process() -> None:
    pg.Model().body("knee")


def test_mechanisms_runs_and_errors_go_between_processes() -> None:
    mechs = [used("four_bar"), used("double_pendulum")]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        for mech, (back, numbers, run) in zip(mechs, pool.map(in_another_process, mechs)):
            assert same(numbers, answers(mech))
            assert same(answers(back), answers(mech))
            here = pg.simulate(mech, t_end=0.05)
            assert np.array_equal(run.q, here.q)
            assert np.array_equal(run.body_pose, here.body_pose)
        with pytest.raises(pg.PgraphError) as caught:
            pool.submit(fails_in_another_process).result()
    with pytest.raises(pg.PgraphError) as expected:
        fails_in_another_process()
    assert str(caught.value) == str(expected.value)
    assert caught.value.problems == expected.value.problems


def public_objects() -> dict[str, Any]:
    """One of each kind, used."""
    mech, cat = used("four_bar"), used("quadruped_hips")
    model = pg.Model.load(pgraph_models.path("quadruped"))
    q, v = mech.home()
    run = pg.simulate(mech, t_end=0.02)
    assert run.body_pose.size
    assert run.plan.parts
    walk = pg.Walk(cat, scenario="trot")
    part = walk.step(0.01)
    controller = walk.controller
    controller(0.0, *walk.controller.start())
    tree = pg.Mechanism(pg.Model.serial(3))
    batch = pg.BatchStepper(tree, 3)
    batch.step()
    assert mech.topology.number(mech.names[0]) == 1
    return {
        "Model": model,
        "Body": model.bodies[0],
        "Mechanism": mech,
        "Topology": mech.topology,
        "Columns": pg.Columns.of(model),
        "Plan": mech.plan(),
        "Assembly": mech.assemble(q + 1e-3, v)[2],
        "Mobility": mech.mobility(),
        "Result": run,
        "Result of a walk": part,
        "Walk": walk,
        "Controller": controller,
        "BatchStepper": batch,
        "footprints": pg.footprints(part),
        "Case": pgraph_models.cases(pgraph_models.case_names()[0])[0],
        "Status": run.status,
    }


OBJECTS = public_objects()


@pytest.mark.parametrize("kind", OBJECTS)
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_public_objects_travel(kind: str, how: str) -> None:
    value = OBJECTS[kind]
    sent = COPIES[how](value)
    assert type(sent) is type(value)
    if kind in ("Model", "Body", "Plan", "Assembly", "Mobility", "footprints", "Status"):
        assert sent == value
    if kind.startswith("Result"):
        assert np.array_equal(sent.q, value.q)
        assert np.array_equal(sent.body_motion.force, value.body_motion.force)
    if kind == "Walk":
        assert np.array_equal(sent.step(0.01).q, copy.deepcopy(value).step(0.01).q)
    if kind == "Controller":
        start = value.start()
        assert np.array_equal(sent(0.1, *start), value(0.1, *start))
    if kind == "BatchStepper":
        assert np.array_equal(sent.acceleration(), value.acceleration())


@pytest.mark.parametrize("kind", ["Model", "Mechanism", "Topology", "Result", "Walk", "Controller"])
def test_a_pickle_of_another_version_says_so(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as other:
        other.setattr(portable, "installed", lambda: "0.0.9")
        written = pickle.dumps(OBJECTS[kind])
    with pytest.raises(pg.InputError) as caught:
        pickle.loads(written)
    text = str(caught.value)
    assert "0.0.9" in text
    assert portable.installed() in text
    assert kind in text
    assert "JSON" in text


def test_a_scene_refuses_to_travel() -> None:
    mech = used("four_bar")
    for value in vars(mech).values():
        if type(value).__name__ == "Scene":
            with pytest.raises(TypeError, match="addresses"):
                pickle.dumps(value)
            return
    pytest.fail("a used mechanism keeps a scene")


UNREAD = """
import pickle, pgraph_core as pg
ball = pg.Shape(kind="sphere", radius=0.1)
ball = pg.Body(name="b", joint="free", q=(0, 0, 0.2, 1, 0, 0, 0), shape=ball)
run = pg.simulate(pg.Model(bodies=[ball], contacts=[pg.Contact(name="c", body="b")]), t_end=0.2)
again = pickle.loads(pickle.dumps(run))
print(again == run, again.contact_force["c"][-1, 5] == run.contact_force["c"][-1, 5])
"""


@pytest.mark.parametrize("options", [(), ("-O",)])
def test_a_run_whose_contacts_nobody_has_read_pickles(options):
    """Also without assertions: the record is made when it is first read."""
    done = subprocess.run(
        [sys.executable, *options, "-c", UNREAD], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "True"]
