"""Kernels are compiled once, for one signature, when one of their sources has changed."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pgraph_core import engine
from pgraph_core.engine.compiler import jit
from pgraph_core.engine.compiler.jit import ENGINE, JIT, KERNELS

USE = """
import numpy as np, pgraph_core as pg, pgraph_models
from importlib import import_module
from pgraph_core.engine import MODULES
from pgraph_core.engine.compiler.jit import KERNELS
for module in MODULES:
    import_module(f"pgraph_core.engine.{module}")
warm = dict(KERNELS)  # others are compiled where a scene first needs them
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
missed = {n: d.stats.cache_misses for n, (d, _) in warm.items() if d.stats.cache_misses}
many = {n: len(d.signatures) for n, (d, _) in KERNELS.items() if len(d.signatures) > 1}
print(missed, many)
"""


@pytest.mark.nightly
def test_warmed_up_kernels_are_all_that_a_session_needs():
    """The cache that `python -m pgraph_core.engine` fills is the one that calls look in."""
    subprocess.run([sys.executable, "-m", "pgraph_core.engine"], check=True, capture_output=True)
    done = subprocess.run([sys.executable, "-c", USE], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "{} {}"


@pytest.mark.nightly
def test_the_compiling_process_ends_when_its_parent_is_gone(tmp_path):
    """A killed parent closes the pipe."""
    command = [sys.executable, "-m", "pgraph_core.engine", "--with-parent"]
    environment = {**os.environ, "PGRAPH_CACHE": str(tmp_path)}
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    )
    child.stdout.readline()  # it compiles
    child.stdin.close()
    assert child.wait(timeout=120) == 1  # 0 after the compilation
    child.stdout.close()




def test_no_two_modules_have_a_kernel_of_one_name():
    """They are kept by name, and compiled for the signature that stands with it."""
    import pgraph_core.engine.stepping.run  # noqa: F401 (registers its kernels)

    assert JIT
    assert {"advance_run", "constrained_dynamics"} <= set(KERNELS)
    dispatcher, signature = KERNELS["advance_run"]
    jit.register(KERNELS, dispatcher, signature)  # again, as a module that is loaded again does

    other = SimpleNamespace(__name__="advance_run", __module__="another")
    with pytest.raises(RuntimeError, match=r"another.*stepping\.run"):
        jit.register(jit.LATER, other, signature)
    assert KERNELS["advance_run"][0] is dispatcher


def test_an_edit_compiles_the_kernels_that_import_it_and_no_others(tmp_path):
    """Its name counts as well: what is saved of a kernel names its module."""
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "tree.py").write_text("def advance(): ...")
    here, there = (jit.source_hash(tmp_path / x / "tree.py") for x in ("here", "there"))
    assert here != there
    tree, moving, contact = (tmp_path / name for name in ("tree.py", "moving.py", "contact.py"))
    sizes = tmp_path / "rows" / "sizes.py"
    sizes.parent.mkdir()
    sizes.write_text("WIDTH = 3")
    tree.write_text("from .rows import sizes as at\nfrom .moving import (\n    advance,\n)\n")
    moving.write_text("def advance(): ...")
    contact.write_text("GAP = 1")
    modules = (tree, moving, contact)

    def hashes():
        for kept in (jit.source_hash, jit._imported, jit._hash):
            kept.cache_clear()
        return [jit.source_hash(module) for module in modules]

    first = hashes()
    assert hashes() == first
    sizes.write_text("WIDTH = 4")
    assert [a == b for a, b in zip(first, hashes(), strict=True)] == [False, True, True]
    sizes.write_text("WIDTH = 3")
    moving.write_text("def advance(): return 1")
    assert [a == b for a, b in zip(first, hashes(), strict=True)] == [False, False, True]


def test_a_kernel_depends_on_every_engine_module_that_python_loads_for_it():
    """Python's own list of loaded modules is the oracle; packages' own files hold no code."""
    code = "import sys, {0}; print(*[m for m in sys.modules if m.startswith('{1}')])"
    engine = "pgraph_core.engine"
    for name in ("tree.dynamics", "stepping.run"):
        command = [sys.executable, "-c", code.format(f"{engine}.{name}", engine)]
        loaded = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        files = {Path(ENGINE, *module.split(".")[2:]).with_suffix(".py") for module in loaded}
        assert {path for path in files if path.is_file()} <= jit.sources(
            Path(ENGINE, *name.split(".")).with_suffix(".py")
        )
