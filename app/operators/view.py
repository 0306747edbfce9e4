"""The Operators tab: sparsity pattern and values at the displayed pose, on pages that show it."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from scipy import io as files
from scipy import sparse

import pgraph_core as pg
from pgraph_core.paper import Operators

from ..core.bridge import Bridge
from ..core.views import NOTHING, Host, Payload, Place, requests, topic
from ..pose.solving import shown_q
from ..pose.view import moment
from . import Client, ExportOperator, Inspected, State


class DownloadView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for asked in requests(old, new, ExportOperator):
            if not available(new, asked.what):
                content = as_file(new, asked.what, asked.suffix)
                self._bridge.download(asked.client, f"{asked.what}.{asked.suffix}", content)


def _inspected(state: State, page: Client) -> tuple[object, ...]:
    """Return the dependencies of the operator on a page."""
    return page.inspected, page.inspected and (state.derived, state.pose, moment(state))


def _shown(state: State, page: Client) -> Payload:
    return NOTHING if page.inspected is None else operator(state, page.inspected)


def operator(state: State, part: Inspected) -> Payload:
    """Return the displayed part of an operator, or the reason if there is none."""
    payload = {"what": part.what, "titles": TITLES}
    problem = available(state, part.what)
    if not problem:
        try:
            shown = picture(matrix(state, part.what), part)
            rows, columns = labels(state, part.what)
        except pg.PgraphError as error:
            problem = str(error)
        else:
            of_rows, of_columns = numbers(state, part.what)
            named = {
                "row_names": rows[slice(*shown.rows)],
                "column_names": columns[slice(*shown.columns)],
                "row_numbers": of_rows[slice(*shown.rows)],
                "column_numbers": of_columns[slice(*shown.columns)],
            }
            return payload | shown._asdict() | named | {"words": WORDS[part.what], "problem": ""}
    return payload | {"problem": problem}


# -- matrices --------------------------------------------------------------------------------------


TITLES = {
    "M": "mass matrix M", "J": "Jacobian J of the tips", "eps_phi": "ε_φ", "Phi": "Φ",
    "S": "adjacency S",
}  # fmt: skip
WORDS = {  # meaning of an entry, equation of the paper
    "M": "inertia between motions, eq. (25) of the paper",
    "J": "speeds of tips for each motion, eq. (20) of the paper",
    "eps_phi": "propagates velocities to the next body, eq. (13) of the paper",
    "Phi": "propagates velocities to all descendants, eq. (16) of the paper",
    "S": "connections between bodies, eq. (1) of the paper",
}
MOST = 96  # cells per side. In larger operators a cell is a block
LARGE = 200  # bodies above which Φ, whose entries grow with the square, is not made
SPATIAL = ("ωx", "ωy", "ωz", "vx", "vy", "vz")


class Picture(NamedTuple):
    """The displayed part of an operator. Each cell is a block of `step` rows and columns."""

    shape: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]
    step: tuple[int, int]
    cells: list[tuple[int, int, float]]  # row, column, (largest) value


def available(state: State, what: str) -> str:
    """Return the reason why an operator cannot be shown now, or ""."""
    n = len(state.derived.names)
    if what == "Phi" and n > LARGE:
        return f"Φ of {n} bodies has too many entries; it is shown up to {LARGE} bodies."
    if what in ("M", "J") and n > LARGE and not state.kernels.ready:
        return "The kernels are still being compiled."
    return ""


def matrix(state: State, what: str) -> Any:
    """Return the operator at the displayed pose as a sparse matrix. Raises PgraphError."""
    top, q = pg.Topology.of(state.model), shown_q(state)
    if what == "S":
        return sparse.coo_array(top.adjacency())
    if what in ("M", "J") and state.kernels.ready:
        mech = pg.Mechanism(state.model)
        return sparse.coo_array(mech.mass_matrix(q) if what == "M" else mech.tip_jacobian(q))
    names = {"M": "mass_matrix", "J": "jacobian"}
    return sparse.coo_array(getattr(Operators(state.model, top, q), names.get(what, what)))


def picture(whole: Any, part: Inspected) -> Picture:
    """Create an operator's cells in a range of rows and columns, with at most MOST per side."""
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
    """Return the row and column labels for an operator."""
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


def numbers(state: State, what: str) -> tuple[list[int], list[int]]:
    """Return the Pgraph number of the body for each row and each column."""
    d = state.derived
    bodies = [d.number[name] for name in d.names]
    motions = [d.number[name] for name in d.names for _ in range(state.model.body(name).dof)]
    spatial, tips = ([k for k in of for _ in SPATIAL] for of in (bodies, sorted(d.tips)))
    found = {"M": (motions, motions), "J": (tips, motions), "S": (bodies, bodies)}
    return found.get(what, (spatial, spatial))


def as_file(state: State, what: str, suffix: str) -> bytes:
    """Export an operator as an NPZ (scipy.sparse.load_npz), CSV or Matrix Market file."""
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


VIEWS = (
    Place(topic("operator", _shown, page=_inspected), 51, Host("operators", "drawer", "Matrices")),
    Place(lambda desk: DownloadView(desk.bridge), 51),
)
