"""Kernels without the branches that a scene does not need, made from the same sources.

A scene of some kinds of motion needs no branch on the others, no armature, no drives and no
constraints. The sweeps of `kinematics` and `articulated` are parsed, every comparison of the
kind that has one answer in the scene is replaced by it, and the rest is compiled with the same
options. The ratio of times is the cost of joint kinds and forces to a scene without them.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Set
from pathlib import Path
from typing import Any

import numba
import numpy as np

import pgraph_core as pg
from pgraph_core.engine import layout as at
from pgraph_core.engine import tree as kernels
from pgraph_core.engine.compiler.jit import OPTIONS
from pgraph_core.engine.vec import finite

from . import native
from .scenes import STEP, Scene, differ
from .timing import Case

GOAL = 1.05
ANSWERS: dict[type[ast.cmpop], Callable[[int, int], bool]] = {
    ast.Eq: operator.eq,
    ast.LtE: operator.le,
    ast.Lt: operator.lt,
}


class Without(ast.NodeTransformer):
    """Removes branches on kinds of motion that a scene lacks, and armature."""

    def __init__(self, kinds: Set[int]):
        self.kinds = kinds

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """A comparison of the kind that has the same answer for all kinds of the scene."""
        asked, constant = ast.unparse(node.left), node.comparators[0]
        answer = ANSWERS.get(type(node.ops[0]))
        if asked not in ("kind", "kind_of(rows, k)") or answer is None:
            return node
        assert isinstance(constant, ast.Name)
        answers = {answer(kind, getattr(at, constant.id)) for kind in self.kinds}
        return ast.Constant(answers.pop()) if len(answers) == 1 else node

    def visit_If(self, node: ast.If) -> Any:
        """Only the branch that is taken."""
        self.generic_visit(node)
        if isinstance(node.test, ast.Constant):
            return node.body if node.test.value else node.orelse
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """x + armature is x."""
        self.generic_visit(node)
        return node.left if "armature_of(" in ast.unparse(node.right) else node


def sweeps(kinds: Set[int]) -> dict[str, Any]:
    """The compiled sweeps of forward dynamics for these kinds alone, by name."""
    names: dict[str, Any] = {}
    for module in ("kinematics", "articulated"):
        path = Path(str(kernels.__file__)).parent / f"{module}.py"
        tree = Without(kinds).visit(ast.parse(path.read_text(encoding="utf-8")))
        tree.body = [
            node
            for node in tree.body
            if not (isinstance(node, ast.ImportFrom) and node.module == "kinematics")
        ]
        names |= {"__package__": kernels.__name__, "__name__": f"{__name__}.{module}"}
        exec(compile(ast.fix_missing_locations(tree), f"lean {module}", "exec"), names)
    return names


def dynamics_loop(kinds: Set[int]) -> Any:
    """As `native.forward_dynamics`, for these kinds alone."""
    articulated = sweeps(kinds)["articulated"]

    @numba.njit(**OPTIONS)
    def loop(rows, const, q, v, tau, work, vdot, n):
        for _ in range(n):
            articulated(rows, const, q, v, tau, work, vdot)

    return loop


def hinge_steps() -> Any:
    """Semi-implicit Euler steps of a tree of hinges that keep the last state, as runs do."""
    articulated = sweeps({at.ROTATE})["articulated"]

    @numba.njit(**OPTIONS)
    def steps(rows, const, q, v, tau, work, vdot, kept, h, n):
        for _ in range(n):
            for j in range(v.shape[0]):
                kept[0, j] = q[j]
                kept[1, j] = v[j]
            articulated(rows, const, q, v, tau, work, vdot)
            for j in range(v.shape[0]):
                v[j] += h * vdot[j]
            if not finite(v):
                return False
            for j in range(v.shape[0]):
                q[j] += h * v[j]
        return True

    return steps


def dynamics(place: Scene, number: int) -> Case:
    """The native loop of forward dynamics, compared with one for the scene's kinds of motion."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    kinds = frozenset(mech.packed.system.rows[1:, at.KIND].tolist())
    loops = {"what the scene needs": dynamics_loop(kinds), "pgraph": native.forward_dynamics}
    sides: dict[str, Callable[[], object]] = {}
    name, found = f"what a scene lacks, {place.name}", []
    for side, loop in loops.items():
        work, vdot = np.zeros((len(mech.packed.system.rows), at.WORK)), np.empty(mech.nv)
        sides[side] = bound(loop, *mech.packed.tree, q, v, tau, work, vdot, number)
        sides[side]()
        found.append(vdot)
    agreement = f"{differ(*found, 1e-12, name)}"
    return Case(name, sides, "call", number, agreement, at_most={"pgraph": GOAL})


def steps(place: Scene, number: int) -> Case:
    """A run of a tree of hinges, compared with a loop for hinges alone.

    No goal is set: a run also keeps a ledger of energy, counts, and may pause, for every scene.
    """
    mech, (_, _, q, v, *_) = pg.Mechanism(place.model), place.state
    space = (
        np.zeros((len(mech.packed.system.rows), at.WORK)),
        np.empty(mech.nv),
        np.empty((2, mech.nv)),
    )
    loop, name = hinge_steps(), f"what a scene lacks, steps of the {place.name}"

    def lean(n: int = number) -> np.ndarray:
        x, y = q.copy(), v.copy()
        assert loop(*mech.packed.tree, x, y, 0 * v, *space, STEP, n)
        return x

    def run(n: int) -> pg.Result:
        return pg.simulate(
            mech, q, v, t_end=n * STEP, method="semi_implicit_euler", step=STEP, frames=2
        )

    agreement = f"{differ(lean(20), run(20).q[-1], 1e-11, name)}"
    return Case(
        name,
        {"what the scene needs": lean, "pgraph": lambda: run(number).timing["step"]},
        "step",
        number,
        agreement,
        clocked=frozenset({"pgraph"}),
    )


def bound(call: Callable[..., object], *arguments: Any) -> Callable[[], object]:
    """A call with its arguments."""
    return lambda: call(*arguments)
