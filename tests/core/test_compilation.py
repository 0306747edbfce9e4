"""Kernels: compiled once for one signature, without allocations, with equal bits everywhere."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from pgraph_core.engine.compiler import archive, jit, sources
from pgraph_core.engine.compiler.jit import ENGINE, JIT, KERNELS
from pgraph_core.engine.compiler.lane import LANE_WIDTH, lanes
from pgraph_core.engine.compiler.lowering.kinds import OPTIONS

from ..nights import at_night

fresh = pytest.mark.skipif(bool(archive.current().stale()), reason="the archive is stale")

USE = """
import sys, numpy as np, pgraph_core as pg, pgraph_models
for name in pgraph_models.names():
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    q, v = mech.home()
    mech.mass_matrix(q), mech.bias_force(q, v), mech.forward_dynamics(q, v), mech.pose(q, "ground")
    mech.forward_dynamics(q, v, external=np.zeros((mech.nb, 6))), mech.tip_jacobian(q)
    mech.jacobian_bias(q, v, mech.names[0]), mech.constrained_dynamics(q, v), mech.energy(q, v)
    for scenario in (None, *(s.name for s in mech.model.scenarios)):
        run = pg.simulate(mech, t_end=0.01, scenario=scenario)
        run.body_pose
    pg.simulate(mech, t_end=0.01, tau=lambda t, q, v: 0 * v)
print("numba" in sys.modules)
"""


@pytest.mark.nightly
@fresh
def test_a_session_with_the_models_that_come_along_compiles_nothing(tmp_path):
    given = {**os.environ, "PGRAPH_CACHE": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", USE], check=True, capture_output=True, text=True, env=given
    )
    assert done.stdout.strip() == "False"
    assert "pgraph:" not in done.stderr  # it says why kernels are compiled; warnings are others


@pytest.mark.nightly
def test_the_compiling_process_ends_when_its_parent_is_gone(tmp_path):
    command = [sys.executable, "-m", "pgraph_core.engine", "--with-parent"]
    environment = {**os.environ, "PGRAPH_CACHE": str(tmp_path)}
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    )
    child.stdout.readline()  # it compiles
    child.stdin.close()
    assert child.wait(timeout=120) == 1  # 0 after the compilation
    child.stdout.close()


def test_functions_of_kernels_last_as_long_as_the_interpreter():
    """It reads their definitions after it has freed modules, here with pages of memory."""
    use = (
        "import pgraph_core as pg\n"
        "lag = pg.Servo(name='d', body='2', kp=5, target=0.4, lag=0.1, start=0.0)\n"
        "run = pg.simulate(pg.Model.serial(2).add(lag), t_end=1, method='rk4', frames=20001)\n"
        "run.drive_force['d']"
    )
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", use]).returncode == 0


def test_no_two_modules_have_a_kernel_of_one_name():
    import pgraph_core.engine.stepping.run  # noqa: F401 (registers its kernels)

    assert JIT
    assert {"advance_run", "constrained_dynamics"} <= set(KERNELS)
    one = KERNELS["advance_run"]
    jit.register(KERNELS, one)  # again, as a module that is loaded again does

    other = SimpleNamespace(__name__="advance_run", __module__="another")
    with pytest.raises(RuntimeError, match=r"another.*stepping\.run"):
        jit.register(jit.LATER, other)
    assert KERNELS["advance_run"] is one


def test_an_edit_compiles_the_kernels_that_import_it_and_no_others(tmp_path):
    """The name counts as well: what is saved of a kernel names its module."""
    texts = {
        "tree": "from .rows import sizes as at\nfrom .moving import (\n    advance,\n)\n",
        "moving": "def advance(): ...",
        "copied": "def advance(): ...",
        "rows/sizes": "WIDTH = 3",
    }
    (tmp_path / "rows").mkdir()

    def hashes(**edits):
        for name, text in {**texts, **edits}.items():
            (tmp_path / f"{name}.py").write_text(text)
        for kept in (sources.sources, sources.imported, sources.digest_of, sources.code_hash):
            kept.cache_clear()
        files = (sources.sources(tmp_path / f"{name}.py") for name in ("tree", "moving", "copied"))
        return [sources.hash_of(one) for one in files]

    first = hashes()
    assert len({*first}) == 3
    for edits, same in (
        ({}, [True, True, True]),
        ({"moving": '"""Said in words."""\n\ndef advance(): ...  # again'}, [True, True, True]),
        ({"rows/sizes": "WIDTH = 4"}, [False, True, True]),
        ({"moving": "def advance(): return 1"}, [False, False, True]),
    ):
        assert [a == b for a, b in zip(first, hashes(**edits), strict=True)] == same


def test_a_kernel_depends_on_every_engine_module_that_python_loads_for_it():
    """Python's own list of loaded modules is the oracle. `__init__` files hold no code."""
    code = "import sys, {0}; print(*[m for m in sys.modules if m.startswith('{1}')])"
    engine = "pgraph_core.engine"
    for name in ("tree.dynamics", "stepping.run"):
        command = [sys.executable, "-c", code.format(f"{engine}.{name}", engine)]
        loaded = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        files = {Path(ENGINE, *module.split(".")[2:]).with_suffix(".py") for module in loaded}
        assert {path for path in files if path.is_file()} <= sources.KEEPING | sources.sources(
            Path(ENGINE, *name.split(".")).with_suffix(".py")
        )


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
    assert bits(PGRAPH_PROCESSOR="generic", PGRAPH_CACHE=str(tmp_path)) == bits()


JITTED = numba.njit(**OPTIONS)


def test_lanes_compute_place_by_place():
    @JITTED
    def poly(x, y, out):
        a, b, c = lanes(x), lanes(y), lanes(out)
        for i in range(a.shape[0]):
            c[i] = -(a[i] + b[i]) * 3 / (2.0 - a[i]) + min(b[i], 0.5) - max(a[i], 0.25)
            c[i] += np.floor(0.0)

    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 5, LANE_WIDTH))
    out = np.empty_like(x)
    poly(x, y, out)
    wanted = -(x + y) * 3 / (2.0 - x) + np.minimum(y, 0.5) - np.maximum(x, 0.25)
    assert np.array_equal(out, wanted)


def test_nothing_is_contracted():
    """a b + c with one rounding would give 2⁻¹⁰⁶."""

    @JITTED
    def product(a, b, c):
        return a * b + c

    x = 1.0 + 2.0**-53 * 2
    assert product(x, x, -(x * x)) == 0.0
    assert OPTIONS["fastmath"] is False


compiled_only = pytest.mark.skipif(not JIT, reason="nothing is compiled")


@compiled_only
def test_a_kernel_that_makes_an_array_does_not_compile():
    @numba.njit(**OPTIONS)
    def allocating(x):
        return np.zeros(3)[0] + x

    with pytest.raises(numba.TypingError, match="zeros"):
        allocating(1.0)


SAME_UNCOMPILED = """
import numpy as np, pgraph_core as pg, pgraph_models
SHORT = {"estimate": False, "frames": 2}
pendulum = pg.Model.load(pgraph_models.path("double_pendulum"))
upper, lower = (body.name for body in pendulum.bodies)
box = pg.Body(name="box", joint="free", link=(0, 0, 0.11), density=1e3,
              shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.2)))
falls = pg.Model(bodies=[box], contacts=[pg.Contact(name="floor", body="box", restitution=0.3)])
for method in ("semi_implicit_euler", "rk4", "dopri5", "dop853", "gauss6", "radau5"):
    run = pg.simulate(pendulum, v={lower: 1.0}, method=method, step=None, **SHORT, t_end=1e-3)
    print(method, run.q[-1].tobytes().hex(), run.v[-1].tobytes().hex())
for method in ("moreau_jean", "dopri5"):
    run = pg.simulate(falls, v={"box": (0, 0, 1, 0, 0, -3)}, method=method, **SHORT, t_end=5e-3)
    print(method, run.q[-1].tobytes().hex(), len(run.events))
four_bar = pg.Stepper(pg.Model.load(pgraph_models.path("four_bar")), scenario="turn")
four_bar.step(n=3)
print(four_bar.q.tobytes().hex())
batch = pg.BatchStepper(pendulum, 2, step=1e-3)
batch.step(n=3)
print(batch.q.tobytes().hex())
mech = pg.Mechanism(pendulum)
q, v = np.array([0.3, 0.2]), np.array([1.0, -1.0])
for found in (mech.mass_matrix(q), *mech.forward_derivatives(q, v), mech.equilibrium()):
    print(np.asarray(found).tobytes().hex())
walk = pg.Walk(pg.Model.load(pgraph_models.path("quadruped_hips")), "trot")
print(walk.step(2e-3).status)
"""


EVERY_MODEL = """
import numpy as np, pgraph_core as pg, pgraph_models, warnings
warnings.simplefilter("error", RuntimeWarning)
for name in pgraph_models.names():
    model = pg.Model.load(pgraph_models.path(name))
    for scenario in (None, *(one.name for one in model.scenarios)):
        for method in ("auto", "rk4", "moreau_jean", "gauss6", "radau5"):
            step = None if method == "auto" else 1e-3
            given = {"scenario": scenario, "method": method, "step": step, "estimate": False}
            try:
                run = pg.simulate(model, t_end=6e-3, **given)
                found = run.q.tobytes().hex()[-64:], run.v.tobytes().hex()[-64:], run.status
            except pg.InputError as error:
                found = str(error)
            print(name, scenario, method, found)
"""

SINGULAR = """
import numpy as np
from pgraph_core.engine.compiler.elementary import atan2, cos, power, sin
from pgraph_core.engine.constraints.proximal import normalise
from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F1, f8, void
import math

@kernel(void(f8, f8, F1))
def arithmetic(x, y, out):
    size = 0.0
    for i in range(int(size)):
        size += out[i]
    out[0] = x / size
    out[1] = math.sqrt(y)
    out[2] = y / x
    out[3] = (0.1 * y) ** 2
    out[4] = normalise(out[6:9], 3)
    out[5] = sin(y) + cos(x) + atan2(y, x) + power(abs(y), x)

for x in (3.0, 0.0, -0.0, 0.3, -2.0, 1e-310, 1e200):
    for y in (-1.0, 0.0, 7.7, 1e6, math.inf, math.nan):
        out = np.zeros(9)
        arithmetic(x, y, out)
        print(np.where(np.isnan(out), np.inf, out).tobytes().hex())
"""


@pytest.mark.parametrize("program", [SINGULAR, *at_night(SAME_UNCOMPILED, EVERY_MODEL)])
def test_kernels_run_as_python_with_the_bits_of_machine_code(program, tmp_path):
    """Also those whose fields are called as attributes of NumPy's records."""
    (file := tmp_path / "program.py").write_text(program)  # kernels are read from their file
    told = [
        subprocess.run(
            [sys.executable, str(file)], check=True, capture_output=True, text=True,
            env={
                **os.environ, "NUMBA_DISABLE_JIT": flag, "PYTHONPATH": os.pathsep.join(sys.path)
            },
        ).stdout
        for flag in ("0", "1")
    ]  # fmt: skip
    assert told[0] == told[1]
