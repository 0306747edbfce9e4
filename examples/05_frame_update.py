"""Pgraph by hand: table, seven steps, Pgraph and jdof, pattern of ε_φ, one frame update.

Run it with `python examples/05_frame_update.py`. docs/paper.md explains what it prints.
"""

import numpy as np

import pgraph_core as pg
from pgraph_core.paper import kernel_operator_of_pgraph


def table(model: pg.Model) -> None:
    """The four columns, and each body's number."""
    tree = pg.Topology.of(model)
    print(f"{'number':>6}  {'body':<10} {'parent':<10} {'DoF':>3}  joint")
    for body in model.bodies:
        number = tree.number(body.name)
        print(f"{number:>6}  {body.name:<10} {body.parent:<10} {body.dof:>3}  {body.joint}")


def seven_steps(parent: list[int], dof: list[int]) -> list[int]:
    """Fig. 4 with a pencil: what each step appends, and the stack SBS after it."""
    untraversed = {
        i: [k for k, p in enumerate(parent, 1) if p == i] for i in range(len(parent) + 1)
    }
    pgraph: list[int] = []
    jdof: list[int] = []
    stack: list[int] = []

    def line(step: str, says: str) -> None:
        print(f"{step:>4}  {says:<46} SBS {stack}")

    i = untraversed[0].pop(0)
    line("1", f"empty Pgraph and jdof; i = {i}, the root")
    while True:
        pgraph, jdof = [*pgraph, i], [*jdof, dof[i - 1]]
        line("2", f"Pgraph gets {i}, jdof gets {jdof[-1]}")
        if len(untraversed[i]) > 1:
            stack.append(i)
            line("3", f"{i} is a separation body: pushed")
        if not untraversed[i]:
            if not stack:
                line("4, 7", f"{i} is a tip and SBS is empty: the end")
                return pgraph
            tip, i = i, stack.pop()
            pgraph, jdof = [*pgraph, i], [*jdof, 0]
            again = len(untraversed[i]) > 1
            if again:
                stack.append(i)
            back = ", pushed back" if again else ""
            line("4, 5", f"{tip} is a tip: pull {i}, Pgraph gets {i}, jdof 0{back}")
            step = "6"
        else:
            step = "4"
        i = untraversed[i].pop(0)
        line(step, f"i = {i}, the left untraversed child")


def pattern(tree: pg.Topology) -> None:
    """Where ε_φ has a block, found from Pgraph alone (Fig. 6)."""
    eps_phi = kernel_operator_of_pgraph(tree.pgraph, np.zeros((tree.nb, 3))).toarray()
    blocks = abs(eps_phi).reshape(tree.nb, 6, tree.nb, 6).sum(axis=(1, 3)) > 0
    for k, row in enumerate(blocks, start=1):
        cells = (f"φ{k},{j}" if there else " .  " for j, there in enumerate(row, start=1))
        print(" ".join(cells).rstrip())


def by_hand(model: pg.Model, q_next: list[float]) -> None:
    """All of it for one model and one step of its joints."""
    tree = pg.Topology.of(model)
    print(f"\n== {model.name}")
    table(model)
    print()
    found = seven_steps(tree.parent.tolist(), tree.dof.tolist())
    assert found == tree.pgraph.tolist()
    print("\nPgraph", tree.pgraph)
    print("jdof  ", tree.jdof)
    print()
    pattern(tree)
    print()
    home = [x for name in tree.names for x in model.body(name).q]
    trace = pg.frame_update_trace(model, home, q_next)
    print(trace)
    position, _ = pg.Mechanism(model).poses(np.array(q_next))
    print("\norigins of the bodies [m]")
    for name, place in zip(tree.names, trace.frames.position):
        print(f"{name:<10}", *(f"{x:8.4f}" for x in place))
    print("equal to the absolute form:", np.allclose(trace.frames.position, position, atol=1e-14))


GRIPPER = pg.Model(
    name="gripper",
    bodies=(
        pg.Body(name="column"),
        pg.Body(name="arm", parent="column", joint="prismatic", axes=(1, 0, 0), link=(0, 0, 0.5)),
        pg.Body(name="hand", parent="arm", axes=(1, 0, 0), link=(0.4, 0, 0)),
        pg.Body(name="finger a", parent="hand", axes=(0, 1, 0), link=(0.1, 0, 0.05)),
        pg.Body(name="finger b", parent="hand", axes=(0, 1, 0), link=(0.1, 0, -0.05)),
    ),
)
WALKER = pg.Model(
    name="walker",
    bodies=(
        pg.Body(name="trunk", joint="free"),
        pg.Body(name="chest", parent="trunk", link=(0, 0, 0.4)),
        pg.Body(name="neck", parent="chest", joint="spherical", link=(0, 0, 0.2)),
        pg.Body(name="head", parent="neck", joint="weld", link=(0, 0, 0.1)),
        pg.Body(name="arm", parent="chest", axes=(0, 1, 0), link=(0, 0.2, 0.1)),
        pg.Body(name="leg", parent="trunk", axes=(0, 1, 0), link=(0, 0, -0.1)),
    ),
)

by_hand(GRIPPER, [0.3, 0.2, -0.5, 0.4, -0.4])
turn = [np.cos(0.25), 0.0, 0.0, np.sin(0.25)]  # half a radian about z
nod = [np.cos(0.1), np.sin(0.1), 0.0, 0.0]
by_hand(WALKER, [1.0, 0.0, 0.1, *turn, 0.3, *nod, -0.2, 0.6])
