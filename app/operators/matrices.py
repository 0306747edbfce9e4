"""The operators at what is shown, as pictures of their pattern and as files (pure)."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from scipy import io as files
from scipy import sparse

import pgraph_core as pg
from pgraph_core.paper import Operators

from ..core.state import Inspected, State
from ..pose.solving import shown_q

TITLES = {
    "M": "mass matrix M", "J": "Jacobian J of the tips", "eps_phi": "ε_φ", "Phi": "Φ",
    "S": "adjacency S",
}  # fmt: skip
EQUATIONS = {
    "M": "eq. (25)", "J": "eq. (20)", "eps_phi": "eq. (13)", "Phi": "eq. (16)", "S": "eq. (1)",
}  # fmt: skip
MOST = 96  # cells a side; of larger operators a cell is a block
LARGE = 200  # bodies above which Φ, whose entries grow with the square, is not made
SPATIAL = ("ωx", "ωy", "ωz", "vx", "vy", "vz")


class Picture(NamedTuple):
    """The part of an operator that is in view; a cell is a block of `step` rows and columns."""

    shape: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]
    step: tuple[int, int]
    cells: list[tuple[int, int, float]]  # row, column, value; of a block its largest


def available(state: State, what: str) -> str:
    """Why an operator cannot be shown now; "" where it can."""
    n = len(state.derived.names)
    if what == "Phi" and n > LARGE:
        return f"Φ of {n} bodies has too many entries; it is shown up to {LARGE} bodies."
    if what in ("M", "J") and n > LARGE and not state.kernels.ready:
        return "The fast code is still being compiled."
    return ""


def matrix(state: State, what: str) -> Any:
    """The operator at what is shown, sparse. Raises PgraphError."""
    top, q = pg.Topology.of(state.model), shown_q(state)
    if what == "S":
        return sparse.coo_array(top.adjacency())
    if what in ("M", "J") and state.kernels.ready:
        mech = pg.Mechanism(state.model)
        return sparse.coo_array(mech.mass_matrix(q) if what == "M" else mech.tip_jacobian(q))
    names = {"M": "mass_matrix", "J": "jacobian"}
    return sparse.coo_array(getattr(Operators(state.model, top, q), names.get(what, what)))


def picture(whole: Any, part: Inspected) -> Picture:
    """The cells of an operator within rows and columns, at most MOST a side."""
    whole = sparse.coo_array(whole)
    rows, columns = _within(part.rows, whole.shape[0]), _within(part.columns, whole.shape[1])
    step = (_step(rows), _step(columns))
    i, j = whole.coords
    inside = (rows[0] <= i) & (i < rows[1]) & (columns[0] <= j) & (j < columns[1])
    inside &= whole.data != 0
    i, j, values = (
        (i[inside] - rows[0]) // step[0],
        (j[inside] - columns[0]) // step[1],
        whole.data[inside],
    )
    order = np.argsort(np.abs(values), kind="stable")  # the largest of a block comes last
    found = {
        (int(a), int(b)): float(f"{x:.6g}") for a, b, x in zip(i[order], j[order], values[order])
    }
    return Picture(whole.shape, rows, columns, step, [(*at, x) for at, x in found.items()])


def _within(span: tuple[int, int] | None, size: int) -> tuple[int, int]:
    low, high = span or (0, size)
    low = min(max(low, 0), max(size - 1, 0))
    return low, min(max(high, low + 1), size)


def _step(span: tuple[int, int]) -> int:
    return max(1, -(-(span[1] - span[0]) // MOST))


def labels(state: State, what: str) -> tuple[list[str], list[str]]:
    """What the rows and the columns of an operator belong to."""
    d = state.derived
    motions = [
        name if body.dof == 1 else f"{name} {i + 1}"
        for name, body in ((name, state.model.body(name)) for name in d.names)
        for i in range(body.dof)
    ]
    spatial = [f"{name} {c}" for name in d.names for c in SPATIAL]
    tips = [f"{d.names[k - 1]} {c}" for k in sorted(d.tips) for c in SPATIAL]
    names = list(d.names)
    return {"M": (motions, motions), "J": (tips, motions), "S": (names, names)}.get(
        what, (spatial, spatial)
    )


def as_file(state: State, what: str, suffix: str) -> bytes:
    """An operator as an NPZ (scipy.sparse.load_npz), CSV or Matrix Market file."""
    whole, out = matrix(state, what), io.BytesIO()
    if suffix == "npz":
        sparse.save_npz(out, whole)
    elif suffix == "mtx":
        files.mmwrite(
            out, whole, comment=f" {state.model.name}: {what}".encode("ascii", "replace").decode()
        )
    else:
        np.savetxt(out, whole.toarray(), delimiter=",", fmt="%.17g")
    return out.getvalue()
