"""Public objects pickle and copy after any use, also between processes, with the same answers."""

import copy
import multiprocessing
import pickle
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
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    q, v = mech.home()
    mech.constrained_dynamics(q, v)
    mech.energy(q, v)
    mech.mobility()
    mech.assemble()
    pg.simulate(mech, t_end=0.01)
    return mech


def answers(mech: pg.Mechanism) -> list[Any]:
    q, v = mech.home()
    v = v + 0.1
    vdot, forces = mech.constrained_dynamics(q, v)
    run = pg.simulate(mech, t_end=0.02, frames=5)
    return [mech.mass_matrix(q), mech.forward_dynamics(q, v), vdot, *forces.values(), run.q, run.v]


def same(a: list[Any], b: list[Any]) -> bool:
    return len(a) == len(b) and all(map(np.array_equal, a, b))


WAYS = {"four_bar": "pickle", "quadruped": "deepcopy", "double_pendulum": "copy"}


@pytest.mark.parametrize(("name", "how"), WAYS.items())
def test_a_used_mechanism_travels_with_equal_bits(name: str, how: str) -> None:
    mech = used(name)
    last = mech.names[-1]
    for given in (mech, mech.edit(last, mass=2.5).edit(last, link=(0.3, 0.1, 0.0))):
        sent = COPIES[how](given)
        assert sent.model == given.model
        assert sent.names == given.names
        assert same(answers(sent), answers(given))


def test_mechanisms_runs_and_errors_go_between_processes() -> None:
    mech = used("four_bar")
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert same(pool.submit(answers, mech).result(), answers(mech))
        run, here = (
            pool.submit(pg.simulate, mech, t_end=0.05).result(),
            pg.simulate(mech, t_end=0.05),
        )
        assert np.array_equal(run.q, here.q)
        assert np.array_equal(run.body_pose, here.body_pose)
        with pytest.raises(pg.PgraphError) as caught:
            pool.submit(pg.Model().body, "knee").result()
    with pytest.raises(pg.PgraphError) as expected:
        pg.Model().body("knee")
    assert str(caught.value) == str(expected.value)
    assert caught.value.problems == expected.value.problems


@pytest.fixture(scope="module")
def objects() -> dict[str, tuple[Any, Any]]:
    mech, cat = used("four_bar"), used("quadruped_hips")
    model, run = pg.Model.load(pgraph_models.path("quadruped")), pg.simulate(mech, t_end=0.02)
    walk = pg.Walk(cat, scenario="trot")
    part, controller = walk.step(0.01), walk.controller
    controller(0.0, *controller.start())
    batch = pg.BatchStepper(pg.Mechanism(pg.Model.serial(3)), 3)
    batch.step()
    itself = lambda x: x  # noqa: E731
    arrays = lambda x: (x.q.tobytes(), x.body_motion.force.tobytes())  # noqa: E731
    return {
        "Model": (model, itself),
        "Body": (model.bodies[0], itself),
        "Mechanism": (mech, lambda x: x.mass_matrix(x.home()[0]).tobytes()),
        "Topology": (mech.topology, lambda x: x.number(mech.names[0])),
        "Assembly": (mech.assemble(mech.home()[0] + 1e-3, mech.home()[1])[2], itself),
        "Mobility": (mech.mobility(), itself),
        "Result": (run, arrays),
        "Result of a walk": (part, arrays),
        "Walk": (walk, lambda x: copy.deepcopy(x).step(0.01).q.tobytes()),
        "Controller": (controller, lambda x: x(0.1, *controller.start()).tobytes()),
        "BatchStepper": (batch, lambda x: x.acceleration().tobytes()),
        "footprints": (pg.footprints(part), itself),
        "Case": (pgraph_models.cases(pgraph_models.case_names()[0])[0], type),
        "Status": (run.status, itself),
    }


@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_public_objects_travel(objects, how: str) -> None:
    for value, given in objects.values():
        sent = COPIES[how](value)
        assert type(sent) is type(value)
        assert given(sent) == given(value)


@pytest.mark.parametrize("kind", ["Model", "Mechanism", "Topology", "Result", "Walk", "Controller"])
def test_a_pickle_of_another_version_is_refused(objects, kind, monkeypatch) -> None:
    with monkeypatch.context() as other:
        other.setattr(portable, "installed", lambda: "0.0.9")
        written = pickle.dumps(objects[kind][0])
    with pytest.raises(pg.InputError) as caught:
        pickle.loads(written)
    assert all(fact in str(caught.value) for fact in ("0.0.9", portable.installed(), kind))


def test_a_run_with_unread_contacts_pickles() -> None:
    """The record of contacts is made when it is first read."""
    ball = pg.Shape(kind="sphere", radius=0.1)
    body = pg.Body(name="b", joint="free", q=(0, 0, 0.2, 1, 0, 0, 0), shape=ball)
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b")])
    run = pg.simulate(model, t_end=0.2)
    again = pickle.loads(pickle.dumps(run))
    assert again.contact_force["c"][-1, 5] == run.contact_force["c"][-1, 5] > 0
    assert again == run
