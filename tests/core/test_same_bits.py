"""Every processor gives the same bits: this one, and a generic one without vector units."""

import os
import subprocess
import sys

import pytest

RUNS = """
import hashlib
import numpy as np
import pgraph_core as pg
import pgraph_models

def told(name, **given):
    run = pg.simulate(pg.Mechanism(pg.Model.load(pgraph_models.path(name))), **given)
    state = np.concatenate((run.q.ravel(), run.v.ravel(), run.vdot.ravel()))
    print(name, given, hashlib.sha256(state.tobytes()).hexdigest(), run.q[-1][:2].tolist())

told("slider_crank", t_end=2.0, step=1e-3, method="rk4")
told("four_bar_windows", t_end=1.0)
told("double_pendulum", t_end=5.0, rtol=1e-9, method="dop853")
told("stiff_pendulum", t_end=0.5, step=1e-2, method="radau5")
told("quadruped", t_end=0.3, scenario="bound")
mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped")))
q, v = mech.home()
tree = mech.model.replace(constraints=(), contacts=(), scenarios=())
many = pg.BatchStepper(tree, 5)
q, v = (np.repeat([x], 5, axis=0) + 0.01 * np.arange(5)[:, None] * (x == 0.0) for x in (q, v))
many.reset(q, v)
print(hashlib.sha256(many.acceleration().tobytes()).hexdigest())
"""


def bits(**environment):
    options = {"env": {**os.environ, **environment}, "capture_output": True, "text": True}
    return subprocess.run([sys.executable, "-c", RUNS], check=True, **options).stdout


@pytest.mark.nightly
def test_a_generic_processor_gives_the_bits_of_this_one(tmp_path):
    """Its kernels are compiled for it, into a cache of its own."""
    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    assert bits(**generic, PGRAPH_CACHE=str(tmp_path)) == bits()
