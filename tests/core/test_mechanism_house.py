"""Mechanisms: their text, threads that share them, the modules that they load."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models


def load(name: str) -> pg.Mechanism:
    return pg.Mechanism(pg.Model.load(pgraph_models.path(name)))


def test_repr_is_short_and_html_shows_every_body():
    mech = load("four_bar")
    text, html = repr(mech), mech._repr_html_()
    assert len(text.splitlines()) <= 2
    assert all(fact in text for fact in ("Mechanism", mech.model.name, str(mech.nb), str(mech.nv)))
    assert all(part in html for part in ("<svg", "<table", *mech.names))


def test_threads_may_share_a_mechanism_and_its_edits():
    """Springs and given torques pass through one workspace: no call may see another's numbers."""
    mech = pg.Mechanism(pg.Model.serial(6).edit("1", stiffness=(3.0,), damping=(0.1,)))
    mechs = [mech, mech.edit(mech.names[2], mass=2.0)]
    rng = np.random.default_rng(0)
    states = [(mechs[i % 2], *rng.normal(size=(3, mech.nv))) for i in range(40)]

    def answers(state):
        m, q, v, tau = state
        return [
            *(m.forward_dynamics(q, v, tau), m.inverse_dynamics(q, v, tau)),
            *(m.mass_matrix(q), m.jacobian(q, m.names[-1]), m.constrained_dynamics(q, v, tau)[0]),
        ]

    alone = [answers(state) for state in states]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            for _ in range(2):
                for mine, found in zip(alone, pool.map(answers, states)):
                    assert all(map(np.array_equal, mine, found))
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.nightly
def test_a_pendulum_loads_no_contact_gait_study_or_lane_module():
    code = """
        import sys
        import pgraph_core as pg
        assert not [m for m in sys.modules if m.split(".")[0] in ("numba", "scipy", "viser")]
        mech = pg.Mechanism(pg.Model(bodies=[pg.Body(name="a", mass=1.0, tip=(1, 0, 0))]))
        assert pg.simulate(mech, t_end=0.01).status.ok
        heavy = ("contact", "engine.contact", "gait", "engine.gait", "study", "verification")
        ours = tuple(f"pgraph_core.{name}" for name in heavy)
        print([m for m in sys.modules if m in ours or m.startswith(tuple(f"{x}." for x in ours))])
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_batches_and_controllers_take_a_model():
    model = pg.Model.serial(3)
    q = np.full((2, 3), 0.1)
    one, other = pg.BatchStepper(model, 2), pg.BatchStepper(pg.Mechanism(model), 2)
    for batch in (one, other):
        batch.reset(q, q)
        batch.step(n=10)
    assert np.array_equal(one.q, other.q)
    cat = pg.Model.load(pgraph_models.path("quadruped_hips"))
    gait = cat.scenario("trot").gait
    assert gait is not None
    start = pg.Controller(cat, gait).start()
    assert np.array_equal(start[0], pg.Controller(pg.Mechanism(cat), gait).start()[0])
    with pytest.raises(pg.InputError, match="Controller"):
        pg.Controller("quadruped", gait)
