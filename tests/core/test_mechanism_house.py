"""What a mechanism shows and loads: names, text, threads, modules."""

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


def test_a_mechanism_shows_at_most_forty_names():
    mech = load("four_bar")
    mech.constrained_dynamics(*mech.home())
    assert len([name for name in dir(mech) if not name.startswith("_")]) <= 40


@pytest.mark.parametrize("name", ["quadruped", "double_pendulum"])
def test_repr_is_short_and_says_what_it_is(name):
    mech = load(name)
    text = repr(mech)
    assert len(text.splitlines()) <= 2
    assert len(text) < 160
    for fact in ("Mechanism", mech.model.name, str(mech.nb), str(mech.nv)):
        assert fact in text


def test_repr_html_has_the_digraph_and_every_body():
    mech = load("four_bar")
    html = mech._repr_html_()
    assert "<svg" in html
    assert "<table" in html
    assert all(name in html for name in mech.names)


def test_threads_may_share_a_mechanism_and_its_edits():
    """Springs and given torques pass through one workspace: no call may see another's numbers."""
    model = pg.Model.serial(6)
    model = model.edit(model.bodies[0].name, stiffness=(3.0,), damping=(0.1,))
    mech = pg.Mechanism(model)
    mechs = [mech, mech.edit(mech.names[2], mass=2.0)]
    rng = np.random.default_rng(0)
    states = [(mechs[i % 2], *rng.normal(size=(3, mech.nv))) for i in range(40)]

    def asked(state):
        m, q, v, tau = state
        return [
            *(m.forward_dynamics(q, v, tau), m.inverse_dynamics(q, v, tau)),
            *(m.mass_matrix(q), m.jacobian(q, m.names[-1]), m.constrained_dynamics(q, v, tau)[0]),
        ]

    alone = [asked(state) for state in states]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            for _ in range(5):
                for mine, found in zip(alone, pool.map(asked, states)):
                    assert all(map(np.array_equal, mine, found))
    finally:
        sys.setswitchinterval(interval)


def test_a_pendulum_loads_no_contact_gait_study_or_lane_module():
    code = """
        import sys
        import pgraph_core as pg
        before = [m for m in sys.modules if m.split(".")[0] in ("numba", "scipy", "viser")]
        assert not before, before
        mech = pg.Mechanism(pg.Model(bodies=[pg.Body(name="a", mass=1.0, tip=(1, 0, 0))]))
        assert pg.simulate(mech, t_end=0.01).status.ok
        ours = [m.removeprefix("pgraph_core.") for m in sys.modules if m.startswith("pgraph_core")]
        heavy = ("contact", "engine.contact", "gait", "engine.gait", "study", "verification")
        print([m for m in ours if any(m == h or m.startswith(h + ".") for h in heavy)])
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_functions_of_a_mechanism_take_a_model():
    model = pg.Model.serial(3)
    mech = pg.Mechanism(model)
    q = np.full((2, 3), 0.1)
    assert np.array_equal(pg.simulate(model, t_end=0.1).q, pg.simulate(mech, t_end=0.1).q)
    one, other = pg.BatchStepper(model, 2), pg.BatchStepper(mech, 2)
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
