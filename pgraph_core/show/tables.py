"""Models, mechanisms and runs as HTML for notebooks; colours come from the page around them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from .digraph import digraph_svg

ROWS = 24  # of a table; a longer one is cut in the middle
DRAWN = 120  # bodies up to which the digraph is drawn


def model_html(model: Any) -> str:
    """The title, the digraph and the table of bodies of a `pg.Model`."""
    counts = [
        _counted(len(getattr(model, field)), one)
        for field, one in (("constraints", "constraint"), ("contacts", "contact"),
                           ("forces", "force"), ("scenarios", "scenario"))
        if getattr(model, field)
    ]  # fmt: skip
    dof = sum(body.dof for body in model.bodies)
    counts = [_counted(len(model.bodies), "body", "bodies"), f"{dof} DoF", *counts]
    return _framed(model.name or "model", ", ".join(counts), _drawn(model) + _bodies(model))


def mechanism_html(mech: Any) -> str:
    """The title, Pgraph and jdof, the digraph and the table of bodies of a `pg.Mechanism`."""
    model = mech.model
    counts = f"{_counted(len(mech.names), 'body', 'bodies')}, nq = {mech.nq}, nv = {mech.nv}"
    vectors = _table(
        [("Pgraph", *mech.topology.pgraph.tolist()), ("jdof", *mech.topology.jdof.tolist())]
    )
    body = vectors + _drawn(model) + _bodies(model)
    return _framed(f"Mechanism of {model.name or 'a model'}", counts, body)


def run_html(run: Any) -> str:
    """How a `pg.Result` ended, its accuracy and its cost, and its notices."""
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
    """Bodies in depth-first order, left child first, and the number of each one's parent."""
    children: dict[str, list[Any]] = {}
    for body in model.bodies:
        children.setdefault(body.parent, []).append(body)
    ordered: list[Any] = []
    known = {body.name for body in model.bodies}
    stack = [body for parent, found in children.items() if parent not in known for body in found]
    stack.reverse()
    while stack:
        body = stack.pop()
        ordered.append(body)
        stack.extend(reversed(children.get(body.name, ())))
    number = {body.name: k for k, body in enumerate(ordered, 1)}
    return ordered, [number.get(body.parent, 0) for body in ordered]


def _drawn(model: Any) -> str:
    bodies, parent = numbered(model)
    if not bodies or len(bodies) > DRAWN:
        return ""
    number = {body.name: k for k, body in enumerate(bodies, 1)}
    ends = [(number.get(c.body, 0), number.get(c.other, 0)) for c in model.constraints]
    loops = [(a, b) for a, b in ends if a and b and a != b and a != parent[b - 1] != b]
    return f"<div>{digraph_svg([body.name for body in bodies], parent, loops)}</div>"


def _bodies(model: Any) -> str:
    bodies, _ = numbered(model)
    head = ("", "body", "parent", "joint", "DoF", "mass [kg]")
    rows = [(k, b.name, b.parent, b.joint, b.dof, f"{b.mass:g}") for k, b in enumerate(bodies, 1)]
    if len(rows) > ROWS:
        left_out = ("…", f"{len(rows) - ROWS} more", "", "", "", "")
        rows = [*rows[: ROWS // 2], left_out, *rows[-ROWS // 2 :]]
    return _table(rows, head)


def _table(rows: Iterable[Sequence[object]], head: Sequence[str] = ()) -> str:
    lines = ["<tr>" + "".join(f"<th>{escape(x)}</th>" for x in head) + "</tr>"] if head else []
    for row in rows:
        lines.append("<tr>" + "".join(f"<td>{escape(str(x))}</td>" for x in row) + "</tr>")
    return f"<table>{''.join(lines)}</table>"


def _framed(title: str, line: str, body: str) -> str:
    return f"<div><strong>{escape(title)}</strong><br>{escape(line)}{body}</div>"


def _counted(n: int, one: str, many: str = "") -> str:
    return f"{n} {one if n == 1 else many or one + 's'}"
