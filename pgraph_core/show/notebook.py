"""Models and runs in notebooks, as HTML, thumbnails and plots."""

from __future__ import annotations

import sys
import tempfile
import webbrowser
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import counted, needed
from ..numbering import canonical, children_of
from ..shapes import picture_of
from ..shapes.contract import Piece
from . import bodies, shapes, stage
from .digraph import digraph_svg
from .stage import GRID

# -- HTML ------------------------------------------------------------------------------------------


MOST_TABLE_ROWS = 24  # limit on the rows of a table, which is cut in the middle
DRAWN = 120  # bodies up to which the digraph is drawn


def model_html(model: Any) -> str:
    """Return the title, digraph and body table of a `pg.Model` as HTML."""
    counts = [
        counted(len(getattr(model, field)), one)
        for field, one in (("constraints", "constraint"), ("contacts", "contact"),
                           ("forces", "force"), ("scenarios", "scenario"), ("sites", "site"),
                           ("outputs", "output"), ("controls", "control"))
        if getattr(model, field)
    ]  # fmt: skip
    dof = sum(body.dof for body in model.bodies)
    counts = [counted(len(model.bodies), "body", "bodies"), f"{dof} DoF of joints", *counts]
    return _framed(model.name or "model", ", ".join(counts), _drawn(model) + _bodies(model))


def mechanism_html(mech: Any) -> str:
    """Return the title, Pgraph and jdof, digraph and body table of a `pg.Mechanism` as HTML."""
    model = mech.model
    counts = f"{counted(len(mech.names), 'body', 'bodies')}, nq = {mech.nq}, nv = {mech.nv}"
    vectors = _table(
        [("Pgraph", *mech.topology.pgraph.tolist()), ("jdof", *mech.topology.jdof.tolist())]
    )
    body = vectors + _drawn(model) + _bodies(model)
    return _framed(f"Mechanism of {model.name or 'a model'}", counts, body)


def run_html(run: Any) -> str:
    """Return the status, accuracy, cost and notices of a `pg.Result` as HTML."""
    header, model = run.header, run.mechanism.model
    facts: list[tuple[object, ...]] = [
        ("method", header["method"]),
        ("time", f"{run.t[0]:g} to {run.t[-1]:g} s, {len(run.t)} frames"),
        ("error estimate", run.accuracy),
        ("energy drift", f"{run.energy_drift:.2g}, relative"),
    ]
    notices = "".join(f"<p>{escape(text)}</p>" for text in run.notices)
    title = f"Run of {model.name or 'a model'}"
    return _framed(title, run.message, _table(facts) + notices)


def numbered(model: Any) -> tuple[list[Any], list[int]]:
    """Return the bodies by number, with the number of each parent."""
    rows = {body.name: row for row, body in enumerate(model.rows, 1)}
    order = canonical([rows.get(body.parent, 0) for body in model.rows])
    ordered = [model.rows[row] for row in order]
    number = {body.name: k for k, body in enumerate(ordered, 1)}
    return ordered, [number.get(body.parent, 0) for body in ordered]


def digraph_of(model: Any) -> tuple[list[str], list[int], list[tuple[int, int]]]:
    """Return (names, parent numbers, pairs of bodies that close loops) for a model's digraph."""
    bodies, parent = numbered(model)
    number = {body.name: k for k, body in enumerate(bodies, 1)}
    ends = [tuple(number.get(name, 0) for name in c.pair) for c in model.constraints]
    loops = [(a, b) for a, b in ends if a and b and a != b and a != parent[b - 1] != b]
    return [body.name for body in bodies], parent, loops


def _drawn(model: Any) -> str:
    if not 0 < len(model.rows) <= DRAWN:
        return ""
    return f"<div>{digraph_svg(*digraph_of(model))}</div>"


def _bodies(model: Any) -> str:
    bodies, _ = numbered(model)
    head = ("", "body", "parent", "joint", "DoF", "mass [kg]")
    rows = [(k, b.name, b.parent, b.joint, b.dof, f"{b.mass:g}") for k, b in enumerate(bodies, 1)]
    if len(rows) > MOST_TABLE_ROWS:
        left_out = ("…", f"{len(rows) - MOST_TABLE_ROWS} more", "", "", "", "")
        rows = [*rows[: MOST_TABLE_ROWS // 2], left_out, *rows[-MOST_TABLE_ROWS // 2 :]]
    return _table(rows, head)


def _table(rows: Iterable[Sequence[object]], head: Sequence[str] = ()) -> str:
    lines = ["<tr>" + "".join(f"<th>{escape(x)}</th>" for x in head) + "</tr>"] if head else []
    for row in rows:
        lines.append("<tr>" + "".join(f"<td>{escape(str(x))}</td>" for x in row) + "</tr>")
    return f"<table>{''.join(lines)}</table>"


def _framed(title: str, line: str, body: str) -> str:
    return f"<div><strong>{escape(title)}</strong><br>{escape(line)}{body}</div>"


# -- a small picture -------------------------------------------------------------------------------


WIDTH, HEIGHT = 132, 88
MOST_PIECES = 400  # pieces that are drawn: the nearest bodies of a large model


def pictures(
    model: Any, poses: Sequence[tuple[np.ndarray, np.ndarray]], *, plain: bool = False
) -> list[str]:
    """Return an SVG of `model` with bodies, by number, at each of the poses (nb, 3), (nb, 3, 3).

    All have the same scale and centre. `plain`: in the colours of the branches, as in 3D.
    """
    known, parent = numbered(model)
    looks = bodies.looks(known, children_of(parent), shapes.branch_colors(parent), plain=plain)
    way = stage.start(model.up, known, poses[0][1] if len(poses) else np.zeros((0, 3, 3)))
    view = np.stack((*stage.frame(np.array(GRID[model.up][1]), way), way))
    every = [
        [
            ((at + outline(piece) @ turn.T) @ view.T, piece.color or look.color, piece.opacity)
            for look, at, turn in zip(looks, *pose) for piece in look.pieces[:MOST_PIECES]
        ]
        for pose in poses
    ]  # fmt: skip
    flat = np.concatenate([np.zeros((0, 2)), *(seen[:, :2] for one in every for seen, *_ in one)])
    low, high = flat.min(axis=0, initial=np.inf), flat.max(axis=0, initial=-np.inf)
    scale = 0.88 * min(np.array((WIDTH, HEIGHT)) / np.maximum(high - low, 1e-9))
    found = []
    for drawn in every:
        nearest = sorted(drawn, key=lambda part: part[0][:, 2].mean())[-MOST_PIECES:]
        inside = "".join(_shape(seen[:, :2], color, opacity, (low + high) / 2, scale)
                         for seen, color, opacity in nearest)  # fmt: skip
        box = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
        svg = f'<svg xmlns="http://www.w3.org/2000/svg" {box} aria-hidden="true">{inside}</svg>'
        found.append(svg)
    return found


def _shape(
    flat: np.ndarray, color: shapes.Color, opacity: float, middle: np.ndarray, scale: float
) -> str:
    """Return the convex outline of the points as SVG, lit from above."""
    at = (WIDTH / 2, HEIGHT / 2) + (flat - middle) * (scale, -scale)
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in hull(at))
    edge = tuple(int(0.72 * c) for c in color)
    seen = f' opacity="{opacity:.3g}"' if opacity < 1 else ""
    return (
        f'<polygon points="{corners}" fill="rgb{color}" stroke="rgb{edge}" stroke-width="0.7"'
        f' stroke-linejoin="round"{seen}/>'
    )


def outline(piece: Piece) -> np.ndarray:
    """Return points (n, 3) in body axes whose convex hull is the piece or its bounding box."""
    return piece.position + picture_of(piece).outline(piece) @ piece.rotation.T


def hull(points: np.ndarray) -> list[tuple[float, float]]:
    """Compute the convex hull of points (n, 2) with Andrew's monotone chain algorithm."""
    ordered = sorted({(round(x, 2), round(y, 2)) for x, y in points.tolist()})
    halves = []
    for sweep in (ordered, ordered[::-1]):
        half: list[tuple[float, float]] = []
        for p in sweep:
            while len(half) > 1 and _turns(half[-2], half[-1], p) <= 0:
                half.pop()
            half.append(p)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _turns(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


# -- columns over time -----------------------------------------------------------------------------


def figure(t: np.ndarray, columns: Mapping[str, tuple[str, np.ndarray]], title: str = "") -> Any:
    """Return a Matplotlib figure of columns {name: (unit, values)} over time, with one panel per
    unit.

    Needs matplotlib.
    """
    panels: dict[str, dict[str, np.ndarray]] = {}
    for name, (unit, values) in columns.items():
        panels.setdefault(unit, {})[name] = values
    pyplot = needed("matplotlib.pyplot", "plot")
    drawn, axes = pyplot.subplots(
        max(1, len(panels)), sharex=True, squeeze=False, layout="constrained",
        figsize=(7.0, 1.2 + 2.0 * len(panels)),
    )  # fmt: skip
    for axis, (unit, members) in zip(axes[:, 0], panels.items()):
        lines = [axis.plot(t, x, label=name)[0] for name, x in members.items()]
        axis.set_ylabel(f"[{unit}]" if unit else "")
        axis.grid(alpha=0.3)
        if len(members) <= 12:
            axis.legend(lines, [_plain(name) for name in members], fontsize="small")
    axes[-1, 0].set_xlabel("t [s]")
    if title:
        drawn.suptitle(_plain(title))
    if "inline" in pyplot.get_backend():
        pyplot.close(drawn)  # a notebook shows what is returned, and once is enough
    return drawn


def _plain(text: str) -> str:
    """Escape text so that Matplotlib does not interpret it as mathematics."""
    return text.replace("$", r"\$")


# -- motion and pages ------------------------------------------------------------------------------


def between(t: np.ndarray, pose: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate `pose` (len(t), nb, 7) at `time` into positions (nb, 3), quaternions (nb, 4)."""
    k = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, max(len(t) - 2, 0)))
    last = min(k + 1, len(t) - 1)
    span = t[last] - t[k]
    s = min(max((time - t[k]) / span, 0.0), 1.0) if span > 0 else 0.0
    a, b = pose[k], pose[last]
    sign = np.where((a[:, 3:] * b[:, 3:]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    wxyz = (1 - s) * a[:, 3:] + s * sign * b[:, 3:]
    return (1 - s) * a[:, :3] + s * b[:, :3], wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)


def opened(page: str, height: int = 480) -> Any:
    """Show a page. Returns an object to display in a notebook, else opens the browser."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is not None and shell.has_trait("kernel"):
        return Embedded(page, height)
    with tempfile.NamedTemporaryFile("w", suffix=".html", delete=False, encoding="utf-8") as file:
        file.write(page)
    webbrowser.open(Path(file.name).as_uri())
    return None


class Embedded:
    """A page embedded in a notebook cell."""

    def __init__(self, page: str, height: int):
        self.page, self.height = page, height

    def _repr_html_(self) -> str:
        frame = 'width="100%" style="border:0"'
        return f'<iframe srcdoc="{escape(self.page)}" {frame} height="{self.height}"></iframe>'
