"""Interactive figures: a single HTML file in which the reader runs, changes and pulls the
mechanism.

It contains the kernels as WebAssembly, the initial memory of a run, a recorded run as a fallback,
and a small 3D view. No external resources are loaded.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..engine import layout as at
from ..errors import InputError, Problem
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..model import Force, Model
from ..model.files import write_atomic
from ..model.links import link
from ..model.settings import STEP
from ..numbering import children_of
from ..result import Result
from ..result.columns import coordinates
from ..shapes import picture_of
from ..shapes.contract import Piece
from ..show import model_html, shapes
from ..show.bodies import Track, looks
from ..show.stage import GRID, depth
from ..simulation import simulate
from ..simulation.options import RTOL
from ..simulation.paths import with_numbers
from . import module
from .opened import Opened, follows, opened
from .run import TOUCHING, LiveRun, Setup, methods_of

HERE = Path(__file__).parent
PICTURES = 60  # recorded pictures a second
USUAL_PICTURES = 10 * PICTURES  # a motion without a scenario or a duration has these
MOST_PICTURES = 3000
ROW, OFFSET, HOME = at.ROW, slice(at.OFFSET, at.OFFSET + 3), slice(at.HOME, at.HOME + 9)
DIGITS = 6  # digits of the numbers of the drawing


def recorded(model: Model, scenario: str | None = None, t_end: float | None = None) -> Result:
    """Return the run for a figure, by a scenario or freely. Raises InputError."""
    mech = Mechanism(model)
    given = model.scenario(scenario) if scenario is not None else None
    end = t_end or (given.t_end if given else USUAL_PICTURES / PICTURES)
    step = (given.step if given else None) or STEP
    asked: dict[str, Any] = {"estimate": False}
    if methods_of(mech, Setup(scenario, step)) == TOUCHING:
        asked |= {"method": TOUCHING[0], "step": step}
    run = simulate(mech, t_end=end, scenario=scenario, **asked)
    if not run.status.ok:
        raise InputError(Problem("export", "", f"the run fails: {run.message}"))
    return run


def exported(
    model: Model, scenario: str | None, fields: Sequence[str], t_end: float | None, path: Path
) -> tuple[Result, str]:
    """Write a figure to `path`. Return the run, and the reason why it is only a recording, or "".

    `fields` are PATH or PATH=low:high of the fields that the reader can change. Raises InputError.
    """
    run = recorded(model, scenario, t_end)
    write_atomic(path, page(run, fields).encode())
    return run, why_recorded(run)


def page(run: Result, fields: Sequence[str] = (), live: bool = True) -> str:
    """Return the HTML page of a run, which only plays it unless it is `live`.

    Raises InputError for fields that cannot be changed in the figure.
    """
    model = run.mechanism.model
    wanted = [opened(model, one) for one in fields]
    engine = _engine(run, wanted) if live else _recording(run)
    drawn = _Drawing(run, wanted if engine["methods"] else ())
    given: dict[str, Any] = {
        "engine": engine,
        "scene": drawn.scene(),
        "recording": drawn.recording(),
    }
    given["link"] = _link(model)
    facts = _facts(run, engine)
    title = model.name or "A mechanism"
    texts = {name: (HERE / name).read_text(encoding="utf-8") for name in SCRIPTS}
    html = (HERE / "figure.html").read_text(encoding="utf-8")
    parts = {
        "TITLE": escape(title),
        "STYLE": (HERE / "figure.css").read_text(encoding="utf-8"),
        "FACTS": facts,
        "TABLE": model_html(model),
        # "<" could end the element early
        "FIGURE": json.dumps(given, default=_plain, separators=(",", ":")).replace("<", "\\u003c"),
        "SCRIPT": "\n".join(texts.values()),
    }
    return re.sub("%([A-Z]+)%", lambda found: parts[found[1]], html)


def _link(model: Model) -> str:
    """Return a link to the model, or "" if none carries it."""
    try:
        return link(model)
    except InputError:
        return ""


SCRIPTS = ("engine.js", "view.js", "figure.js")


# -- the engine ------------------------------------------------------------------------------------


def _engine(run: Result, wanted: Sequence[Opened]) -> dict[str, Any]:
    """Return the data for the scripts to compute with, or no runs and the reason."""
    header, mech, found = run.header, run.mechanism, _recording(run)
    try:
        if refused := why_recorded(run):
            raise InputError(Problem("export", "", refused))
        setup = _setup(run, found["step"])
        methods = methods_of(mech, setup)
        methods = tuple(sorted(methods, key=lambda name: name != header["method"]))
        make = partial(_made, setup=setup)
        runs = {method: make(mech, method) for method in methods}
    except InputError as problem:
        if wanted and not module.stale():
            raise
        if not module.stale():  # only shown to the author; readers have a recording
            found["refused"] = f"This scene cannot be computed here: {problem.problems[0].text}."
        return found
    for field, of in follows(mech.model, runs, wanted, make):
        place, entry = field.path, {method: what._asdict() for method, what in of.items()}
        found["open"].append(
            {"path": place.text, "value": place.present, "low": field.low, "high": field.high,
             "values": field.values, "label": field.label, "unit": field.path.unit(mech.model),
             "of": entry}
        )  # fmt: skip
    found["methods"], found["wasm"] = methods, packed(module.wasm())
    found["runs"] = {
        method: {
            "header": one.header(),
            "image": packed(bytes(one.memory())),
            "usual": usual(run, method),
        }
        for method, one in runs.items()
    }
    found["how"] = _how(run, methods[0])
    return found


def _recording(run: Result) -> dict[str, Any]:
    """Return the data of a figure without kernels."""
    return {
        "t_start": float(run.t[0]), "t_end": float(run.t[-1]), "step": run.header["step"] or STEP,
        "methods": [], "runs": {}, "open": [], "kernels": module.NAMES, "wasm": "", "refused": "",
        "how": "",
    }  # fmt: skip


def usual(run: Result, method: str) -> dict[str, float]:
    """Return the default {"step" or "rtol": value} for a method, taken from the run if possible."""
    step, rtol = run.header["step"], run.header["rtol"]
    if method == run.header["method"]:
        return {"step": step} if rtol is None else {"rtol": rtol}
    return {"rtol": rtol or RTOL} if METHODS[method].adaptive else {"step": step or STEP}


def _how(run: Result, method: str) -> str:
    """Describe the method that computes the motion in the figure, and the reason for its choice."""
    header = run.header
    ((name, value),) = usual(run, method).items()
    text = f"{method}, {name} {value:g}{' s' if name == 'step' else ''}"
    if method == header["method"]:
        return f"{text}, as recorded"
    return f"{text}, since {header['method']} is not in figures of this scene"


def _made(mech: Mechanism, method: str, setup: Setup) -> LiveRun:
    return LiveRun(mech, setup, method)


def _setup(run: Result, step: float) -> Setup:
    header, t = run.header, float(run.t[0])
    forces = tuple(Force(**given) for _, _, given in header["forces"])
    setup = Setup(header["scenario"], step, t, None, forces)
    one = LiveRun(run.mechanism, setup, methods_of(run.mechanism, setup)[0])
    if np.array_equal(one.record.q, run.q[0]) and np.array_equal(one.record.v, run.v[0]):
        return setup
    return setup._replace(state=(run.q[0], run.v[0]))


def why_recorded(run: Result) -> str:
    """Return the reason why the figure of a run only plays the recording, or ""."""
    if run.header.get("given_torques"):
        return "its torques come from Python, which a browser does not run"
    if run.header.get("inputs"):
        return "its inputs were given to the run alone; put them into the model"
    if run.header.get("stabilise") != "project" and len(run.constraint_force):
        return "its constraints are not kept by projection"
    if any({event.before, event.after} == {"on", "off"} for event in run.contacts.events):
        return "its constraints are switched on the way, which a figure cannot do"
    if not run.status.ok:
        return f"the run fails: {run.message}"
    return module.stale()


def packed(content: bytes) -> str:
    """Compressed, as text."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


# -- the drawing -----------------------------------------------------------------------------------


class _Drawing:
    """The pieces of the bodies and their recorded poses."""

    def __init__(self, run: Result, wanted: Sequence[Opened]):
        self.run, self.wanted, self.mech = run, wanted, run.mechanism
        names, model = self.mech.names, self.mech.model
        most = int(np.clip(PICTURES * (run.t[-1] - run.t[0]), PICTURES, MOST_PICTURES)) + 1
        rows = np.linspace(0, len(run.t) - 1, min(len(run.t), most)).round().astype(int)
        self.rows = np.unique(rows)
        self.pose = np.asarray(run.body_pose)[self.rows]
        self.turns = shapes.to_matrix(self.pose[..., 3:])
        self.bodies = [model.body(name) for name in names]
        self.parent = self.mech.topology.parent.tolist()

    def looks(self, model: Model) -> list[Any]:
        """Return the appearance of the bodies in a model with the same names."""
        bodies = [model.body(name) for name in self.mech.names]
        children, colors = children_of(self.parent), shapes.branch_colors(self.parent)
        return looks(bodies, children, colors)

    def scene(self) -> dict[str, Any]:
        """Return the pieces and the camera target."""
        model, system = self.mech.model, self.mech.packed.system
        found = self.looks(model)
        track = Track(found, self.pose, np.array(GRID[model.up][1]))
        size, low, high = track.size, track.corners.min(axis=0), track.corners.max(axis=0)
        ground = depth(model, self.bodies, self.parent, self.pose[0, :, :3], size)
        pieces, meshes = self._pieces(found)
        numbers = system.bodies_f
        columns = [
            {"name": prefix + name, "unit": unit + per, "of": kind, "index": i}
            for kind, prefix, per, each in zip("qv", ("", "v."), ("", "/s"), coordinates(self.mech))
            for i, (name, unit) in enumerate(each)
        ]
        return {
            "columns": columns,
            "pieces": pieces, "meshes": meshes, "up": model.up, "size": size,
            "center": (low + high) / 2, "low": -ground, "cell": shapes.spaced(size) / 5,
            "mass": sum(body.mass for body in self.bodies),
            "travels": track.travels, "start": track.start,
            "bodies": [
                {"name": name, "row": system.bodies_i[k, ROW], "offset": numbers[k, OFFSET],
                 "home": numbers[k, HOME]}
                for k, name in enumerate(self.mech.names, 1)
            ],
        }  # fmt: skip

    def _pieces(self, found: Sequence[Any]) -> tuple[list[dict[str, Any]], list[Any]]:
        meshes: list[Any] = []
        drawn = []
        for k, look in enumerate(found):
            for piece in look.pieces:
                one: dict[str, Any] = {
                    "body": k, "kind": piece.kind, "size": piece.size, "taper": piece.taper,
                    "position": piece.position, "rotation": piece.rotation.ravel(),
                    "color": piece.color or look.color, "opacity": piece.opacity, "follows": [],
                }  # fmt: skip
                if picture_of(piece).faceted:
                    solid = shapes.mesh([Piece(
                        piece.kind, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), np.eye(3), piece.file
                    )])  # fmt: skip
                    one["kind"], one["mesh"] = "mesh", len(meshes)
                    places = [float(f"{x:.{DIGITS}g}") for x in solid.vertices.ravel().tolist()]
                    meshes.append((places, solid.faces.ravel()))
                drawn.append(one)
        for field in self.wanted:
            self._follow(field, drawn)
        return drawn, meshes

    def _follow(self, field: Opened, drawn: Sequence[dict[str, Any]]) -> None:
        """Record the change of the pieces between both ends of the range of a field."""
        ends = (with_numbers(self.mech.model, [field.path], [x]) for x in (field.low, field.high))
        low, high = ([p for look in self.looks(model) for p in look.pieces] for model in ends)
        if not len(low) == len(high) == len(drawn):
            return
        span = field.high - field.low
        for one, a, b in zip(drawn, low, high):
            slope = {
                name: (np.subtract(getattr(b, name), getattr(a, name)) / span)
                for name in ("size", "position")
            }
            if any(rate.any() for rate in slope.values()):
                one["follows"].append((field.path.text, field.path.present, slope))

    def recording(self) -> dict[str, Any]:
        """Return the times, states and poses from the recorded run."""
        run, rows = self.run, self.rows
        parts = [run.t[rows], run.q[rows], run.v[rows]]
        drawn = [self.pose[..., :3], self.turns]
        data = b"".join(np.ascontiguousarray(a, np.float64).tobytes() for a in parts)
        data += b"".join(np.ascontiguousarray(a, np.float32).tobytes() for a in drawn)
        sizes = {"count": len(rows), "bodies": len(self.bodies)}
        return sizes | {"nq": self.mech.nq, "nv": self.mech.nv, "data": packed(data)}


def _facts(run: Result, engine: dict[str, Any]) -> str:
    """Describe how the run was recorded, and the effect of changing an open field."""
    header = run.header
    step = f"step {header['step']:g} s" if header["step"] else f"rtol {header['rtol']:g}"
    text = f"{run.t[0]:g} to {run.t[-1]:g} s, Pgraph {header['version']}"
    text = f"Recorded by {header['why']}; {step}, {text}."
    if engine["how"]:
        text += f" Computed here by {engine['how']}."
    if engine["open"]:
        text += " A slider changes one number and what the model derives from it,"
        text += " so the inertia of a body may stay as it is while its mass changes."
    return escape(text)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value.tolist()
