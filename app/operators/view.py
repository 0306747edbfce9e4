"""The Operators tab: sparsity pattern and values at the displayed pose, on pages that show it."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import io as files
from scipy import sparse
from scipy.sparse.linalg import spsolve_triangular

import pgraph_core as pg
from pgraph_core.paper import Operators, bodies_of, phi, tip_mobility
from pgraph_core.result.bodies import outer_wrenches

from ..core.bridge import Bridge
from ..core.views import NOTHING, Host, Payload, Place, requests, topic
from ..pose.solving import shown_frame, shown_q, shown_v
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
    titles = {what: (one.symbol, one.title) for what, one in OPERATORS.items()}
    payload = {"what": part.what, "symbol": OPERATORS[part.what].symbol, "titles": titles}
    problem = available(state, part.what)
    if not problem:
        try:
            shown = picture(matrix(state, part.what), part)
        except pg.PgraphError as error:
            problem = str(error)
        else:
            named = {}
            for side, span in (("row", shown.rows), ("column", shown.columns)):
                marks, names = sides(state, part.what)[side]
                named |= {f"{side}_numbers": marks[slice(*span)]}
                named |= {f"{side}_names": names[slice(*span)]}
            words = OPERATORS[part.what].words
            return payload | shown._asdict() | named | {"words": words, "problem": ""}
    return payload | {"problem": problem}


# -- matrices --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Now:
    """The displayed state, with the sources of the operators."""

    state: State

    @cached_property
    def q(self) -> np.ndarray:
        return shown_q(self.state)

    @cached_property
    def v(self) -> np.ndarray:
        v = shown_v(self.state)
        bodies = bodies_of(self.state.model, self.topology)
        return np.array([x for body in bodies for x in body.v], dtype=float) if v is None else v

    @cached_property
    def topology(self) -> pg.Topology:
        return pg.Topology.of(self.state.whole)

    @cached_property
    def paper(self) -> Operators:
        return Operators(self.state.model, self.topology, self.q, self.v)

    @property
    def ready(self) -> bool:
        """Check whether the kernels are compiled, which are faster than the operators."""
        return self.state.kernels.ready

    @cached_property
    def mech(self) -> pg.Mechanism:
        return pg.Mechanism(self.state.whole)

    @cached_property
    def J(self) -> np.ndarray:
        return self.mech.tip_jacobian(self.q) if self.ready else self.paper.jacobian

    @cached_property
    def M(self) -> np.ndarray:
        return self.mech.mass_matrix(self.q) if self.ready else self.paper.mass_matrix

    @cached_property
    def C(self) -> np.ndarray:
        return self.mech.bias_force(self.q, self.v) if self.ready else self.paper.bias_force

    @cached_property
    def V(self) -> np.ndarray:
        """The spatial velocities of the bodies, (6 nb,)."""
        ready = self.ready
        found = self.mech.body_motion(self.q, self.v).velocity if ready else self.paper.V
        return np.reshape(found, -1)

    def of_run(self, field: str) -> np.ndarray:
        """Return the frame of an array of the run, as one vector."""
        result, frame = self._run(field)
        return np.asarray(getattr(result, field))[frame].reshape(-1)

    @cached_property
    def outer(self) -> np.ndarray:
        """The term Φ_Tᵀ F_T of eq. (22), (6 nb,): what bodies exert on all that is no joint."""
        result, frame = self._run("joint_force")
        return -outer_wrenches(result, slice(frame, frame + 1)).reshape(-1)

    def _run(self, field: str) -> tuple[pg.Result, int]:
        frame = shown_frame(self.state)
        if frame is None or self.state.run is None:  # `available` says so before
            raise pg.InputError(pg.Problem("operators", field, NO_RUN))
        return self.state.run.result, frame


def table(vectors: Any) -> np.ndarray:
    """Return spatial vectors (6 n,) or (n, 6) as (6, n), one column for each."""
    return np.reshape(vectors, (-1, 6)).T


# -- equations of several terms, side by side: the first is the sum of the others ------------------


def velocities(now: Now) -> np.ndarray:
    """Return V, φV and Hθ′ of each body (nb, 18), eq. (5)."""
    H, eps_phi = now.paper.H, now.paper.eps_phi
    return beside(now.V, eps_phi @ now.V, H @ now.v)


def accelerations(now: Now) -> np.ndarray:
    """Return V′, φV′, Hθ″ and a of each body (nb, 24), eq. (8)."""
    H, eps_phi, Vdot = now.paper.H, now.paper.eps_phi, now.of_run("body_acceleration")
    return beside(Vdot, eps_phi @ Vdot, H @ now.of_run("vdot"), now.paper.a)


def beside(*vectors: np.ndarray) -> np.ndarray:
    """Return spatial vectors (6 n,) as (n, 6 k), side by side."""
    return np.hstack([np.reshape(x, (-1, 6)) for x in vectors])


def torques(now: Now) -> list[np.ndarray]:
    """Return τ, with that of the armature, ℳθ″, C and JᵀF_T, each (nv,), eq. (24)."""
    vdot, paper = now.of_run("vdot"), now.paper
    tau = paper.H.T @ now.of_run("joint_force") + paper.armature * vdot
    inverse = sparse.eye_array(len(now.outer)) - paper.eps_phi.T  # the inverse of Φᵀ, but sparse
    carried = spsolve_triangular(inverse.tocsr(), now.outer, lower=False, unit_diagonal=True)
    return [tau, now.M @ vdot, now.C, paper.H.T @ carried]


def arms(now: Now) -> np.ndarray:
    """Return O, ℓ, ℓ_c and V_c of each body (nb, 15), fig. 3."""
    paper, V = now.paper, now.V.reshape(-1, 6)
    centre = [R @ body.com for R, body in zip(paper.rotation, paper.bodies)]
    V_c = [phi(arm) @ one for arm, one in zip(centre, V)]
    return np.hstack((paper.position, paper.link, centre, V_c))


class Shown(NamedTuple):
    """An operator of the paper on the page. Vectors are rows, spatial vectors have six rows.

    An equation of several terms has them side by side, for each body.
    """

    symbol: str
    title: str
    words: str  # meaning of an entry, number of its equation in the paper
    rows: str  # owner of a row, a key of `sides`
    columns: str
    value: Callable[[Now], Any]
    large: bool = True  # made even if paths between bodies are too many
    of_run: bool = False  # needs the accelerations of a run


OPERATORS = {
    "M": Shown(
        "M", "mass matrix", "inertia between motions, eq. (25)",
        "motions", "motions",
        lambda now: now.M, False,
    ),
    "C": Shown(
        "C", "bias force", "force of velocities and gravity on each motion, eq. (25)",
        "", "motions",
        lambda now: [now.C], False,
    ),
    "J": Shown(
        "J", "Jacobian of the tips", "speeds of tips for each motion, eq. (20)",
        "tips", "motions", lambda now: now.J, False,
    ),
    "S": Shown(
        "S", "adjacency", "connections between bodies, eq. (1)",
        "bodies", "bodies", lambda now: now.topology.adjacency(),
    ),
    "eps_phi": Shown(
        "ε_φ", "kernel operator",
        "φ, which propagates velocities to the next body, eq. (6) and eq. (13)",
        "spatial", "spatial", lambda now: now.paper.eps_phi,
    ),
    "Phi": Shown(
        "Φ", "propagation operator",
        "propagates velocities to all descendants, eq. (16)",
        "spatial", "spatial", lambda now: now.paper.Phi, False,
    ),
    "Phi_T": Shown(
        "Φ_T", "propagation to the tips",
        "propagates velocities from tip bodies to their tips, eq. (18)",
        "tips", "spatial", lambda now: now.paper.Phi_T,
    ),
    "H": Shown(
        "H", "joint map", "axes of motions, eq. (6) and eq. (7)",
        "spatial", "motions", lambda now: now.paper.H,
    ),
    "M_k": Shown(
        "M_k", "spatial masses", "inertia of each body about its origin, eq. (12)",
        "spatial", "spatial", lambda now: now.paper.M,
    ),
    "a": Shown(
        "a", "velocity terms", "acceleration across joints by velocities, eq. (9)",
        "twist", "bodies", lambda now: table(now.paper.a),
    ),
    "b": Shown(
        "b", "gyroscopic forces", "torque and force by velocities, eq. (12)",
        "wrench", "bodies", lambda now: table(now.paper.b),
    ),
    "V": Shown(
        "V", "spatial velocities", "velocity of each body, eq. (17)",
        "twist", "bodies",
        lambda now: table(now.V), False,
    ),
    "V_T": Shown(
        "V_T", "tip velocities", "velocity of each tip, eq. (19) and eq. (27)",
        "twist", "tip bodies", lambda now: table(now.J @ now.v), False,
    ),
    "Jdot": Shown(
        "J′θ′", "bias of the tips", "acceleration of each tip at θ″ = 0, eq. (27)",
        "twist", "tip bodies",
        lambda now: table(
            [now.paper.point_bias(k, now.paper.bodies[k - 1].tip_point) for k in now.topology.tips]
        ),
        False,
    ),
    "Vdot": Shown(
        "V′", "spatial accelerations", "acceleration of each body, eq. (21)",
        "twist", "bodies", lambda now: table(now.of_run("body_acceleration")), of_run=True,
    ),
    "F": Shown(
        "F", "joint forces", "torque and force of each joint on its body, eq. (22)",
        "wrench", "bodies", lambda now: table(now.of_run("joint_force")), of_run=True,
    ),
    "tau": Shown(
        "τ", "torques", "part of F along each motion, eq. (23)",
        "", "motions", lambda now: [now.paper.H.T @ now.of_run("joint_force")],
        of_run=True,
    ),
    "vdot": Shown(
        "θ″", "accelerations", "acceleration of each motion, eq. (26)",
        "", "motions", lambda now: [now.of_run("vdot")], of_run=True,
    ),
    "Omega": Shown(
        "Ω", "mobility of the tips", "accelerations of tips by unit forces on them, eq. (29)",
        "tips", "tips", lambda now: tip_mobility(now.M, now.J, now.paper.bodies), False,
    ),
    "eq5": Shown(
        "Eq. 5", "velocity propagation",
        "V = φV + Hθ′: the parent's velocity and that across the joint, eq. (5)",
        "bodies", "velocities", velocities, False,
    ),
    "eq8": Shown(
        "Eq. 8", "acceleration propagation",
        "V′ = φV′ + Hθ″ + a: the parent's acceleration and that across the joint, eq. (8)",
        "bodies", "accelerations", accelerations, of_run=True,
    ),
    "eq24": Shown(
        "Eq. 24", "inverse dynamics",
        "τ = Mθ″ + C + JᵀF_T; F_T: forces that are not those of joints, eq. (24)",
        "torques", "motions", torques, False, True,
    ),
    "fig3": Shown(
        "Fig. 3", "vectors of the bodies",
        "origins O, links ℓ, arms ℓ_c of centres of mass and their velocities V_c, fig. 3",
        "bodies", "vectors", arms, False,
    ),
}  # fmt: skip
NO_RUN = "Press Play: accelerations and forces are those of a run."
MOST = 96  # cells per side. In larger operators a cell is a block
LARGE = 200  # bodies above which products along paths, which grow with the square, are not made
AXES = ("x", "y", "z")
TWIST = ("ωx", "ωy", "ωz", "vx", "vy", "vz")
WRENCH = ("τx", "τy", "τz", "fx", "fy", "fz")
TERMS = {  # the terms of an equation and their components
    "velocities": {"V": TWIST, "φV": TWIST, "Hθ′": TWIST},
    "accelerations": {"V′": TWIST, "φV′": TWIST, "Hθ″": TWIST, "a": TWIST},
    "torques": {"τ": ("",), "Mθ″": ("",), "C": ("",), "JᵀF_T": ("",)},
    "vectors": {"O": AXES, "ℓ": AXES, "ℓ_c": AXES, "V_c": TWIST},
}


class Picture(NamedTuple):
    """The displayed part of an operator. Each cell is a block of `step` rows and columns."""

    shape: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]
    step: tuple[int, int]
    cells: list[tuple[int, int, float]]  # row, column, (largest) value


def available(state: State, what: str) -> str:
    """Return the reason why an operator cannot be shown now, or ""."""
    n, one = len(state.derived.names), OPERATORS[what]
    if one.of_run and shown_frame(state) is None:
        return NO_RUN
    if one.large or n <= LARGE:
        return ""
    if what == "Phi":
        return f"Φ of {n} bodies has too many entries; it is shown up to {LARGE} bodies."
    return "" if state.kernels.ready else "The kernels are still being compiled."


def matrix(state: State, what: str) -> Any:
    """Return the operator at the displayed state as a sparse matrix. Raises PgraphError."""
    return sparse.coo_array(OPERATORS[what].value(Now(state)))


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


def sides(state: State, what: str) -> dict[str, tuple[list[Any], list[str]]]:
    """Return the marks and names of the rows and columns of an operator.

    A mark is the Pgraph number of the body, or the component where all bodies share a row.
    """
    d = state.derived
    bodies = [(d.number[name], name) for name in d.names]
    motions = [
        (k, name if dof == 1 else f"{name} {i + 1}")
        for k, name in bodies
        for dof in [state.whole.body(name).dof]
        for i in range(dof)
    ]
    tips = [(k, d.names[k - 1]) for k in sorted(d.tips)]
    found: dict[str, Sequence[tuple[Any, str]]] = {
        "": [("", "")], "bodies": bodies, "tip bodies": tips, "motions": motions,
        "spatial": [(k, f"{name} {c}") for k, name in bodies for c in TWIST],
        "tips": [(k, f"{name} {c}") for k, name in tips for c in TWIST],
        "twist": [(c, c) for c in TWIST], "wrench": [(c, c) for c in WRENCH],
    }  # fmt: skip
    for name, terms in TERMS.items():
        found[name] = [(x, f"{x} {c}".strip()) for x, each in terms.items() for c in each]
    one = OPERATORS[what]
    return {
        side: ([k for k, _ in found[of]], [name for _, name in found[of]])
        for side, of in (("row", one.rows), ("column", one.columns))
    }


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
