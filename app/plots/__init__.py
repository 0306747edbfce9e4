"""Time series plots for a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import Field

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.errors import counted
from pgraph_core.model.output import OF_JOINT
from pgraph_core.model.segments import segment
from pgraph_core.packing.signals import known_forces
from pgraph_core.pulleys import without_segment
from pgraph_core.result.beams import MOMENT, columns_of_beams
from pgraph_core.result.bodies import all_forces, units_of_drives
from pgraph_core.result.columns import columns_of_states
from pgraph_core.result.records import FREE
from pgraph_core.show.notebook import between, pictures
from pgraph_core.show.shapes import to_matrix

from .. import run
from ..core import state
from ..core.cells import Display
from ..core.events import FromPage, Text
from ..core.state import Names, with_client
from ..pose.solving import degrees

POINTS = 1200  # pairs of extremes a curve: more than a screen has columns
XYZ = ("x", "y", "z")
SCENE = ""  # the body of what belongs to none
MANY = "\n"  # between the names of several bodies, of which one component is plotted
VALUE = "x"  # the word before the name of a control in columns
POSES, STRIP = "poses", 6  # pictures of the run, evenly over it


class Signal(NamedTuple):
    """A group of curves: one quantity of a body, a constraint, a contact or the whole scene.

    For several bodies, a signal is a single component, such as 'velocity.z' or 'q.1' of 'a' and
    'b'.
    """

    kind: str
    of: str  # a name, names with MANY between, or SCENE

    @property
    def quantity(self) -> str:
        """The kind of signal without its component."""
        return self.kind.partition(".")[0]

    @property
    def component(self) -> str:
        """The plotted component for several bodies, or "" for all."""
        return self.kind.partition(".")[2]

    @property
    def bodies(self) -> list[str]:
        """The names of the bodies or parts that the signal describes."""
        return self.of.split(MANY)


class Curve(NamedTuple):
    """A line in a plot."""

    label: str
    t: list[float]  # [s]
    y: list[float]
    unit: str = ""  # unit of y


class Kind(NamedTuple):
    """A quantity that can be read from a result."""

    label: str
    unit: str
    read: Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]  # labels, (len(t), n)


def body(array: str, first: int) -> Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]:
    """Return a reader for three columns of a body's row in an array (n, nb, ...)."""

    def read(run: pg.Result, name: str) -> tuple[Sequence[str], np.ndarray]:
        k = run.mechanism.topology.number(name) - 1
        return XYZ, getattr(run, array)[:, k, first : first + 3]

    return read


def joint(array: str, size: str) -> Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]:
    """Return a reader for a joint's columns in q, v or v', as many as its field `size` says."""

    def read(run: pg.Result, name: str) -> tuple[Sequence[str], np.ndarray]:
        model, first = run.mechanism.model, 0
        count = len(getattr(model.body(name), size))
        for before in run.mechanism.names[: run.mechanism.topology.number(name) - 1]:
            first += len(getattr(model.body(before), size))
        return [str(k + 1) for k in range(count)], getattr(run, array)[:, first : first + count]

    return read


def named(array: str, first: int) -> Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]:
    """Return a reader for three columns of an array that a run stores by name."""
    return lambda run, name: (XYZ, getattr(run, array)[name][:, first : first + 3])


def single(array: str) -> Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]:
    """Return a reader for fields with one value per name."""
    return lambda run, name: (("",), np.asarray(getattr(run, array)[name])[:, None])


def of_cam(field: str) -> Callable[[pg.Result, str], tuple[Sequence[str], np.ndarray]]:
    """Return a reader for a number of the contact of a cam."""
    return lambda run, name: (("",), getattr(run.cams[name], field)[:, None])


def limit(run: pg.Result, name: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the torque or force of a limit along its coordinate."""
    return ("",), run.contacts.limit[name][:, None]


def reading(run: pg.Result, name: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the readings of an output, then the last samples of an imperfect one."""
    found = run.mechanism.model.part(name, kind="output")
    parts, exact = found.reading.parts, run.outputs[name].reshape(len(run.t), -1)
    if found.imperfect is None:
        return parts, exact
    samples = run.measured[name]
    last = np.searchsorted(samples.t, run.t, side="right") - 1
    measured = samples.value.reshape(len(samples.t), -1)[np.maximum(last, 0)]
    measured[last < 0] = np.nan  # no sample was taken yet
    both = np.concatenate((exact, measured), axis=1)
    return (*parts, *(f"{part} measured".strip() for part in parts)), both


def state_of(run: pg.Result, name: str) -> tuple[Sequence[str], np.ndarray]:
    """Return a value or state of a control or muscle, such as "x.speed" or "activation.biceps"."""
    return ("",), columns_of_states(run)[name].values[:, None]


def energies(run: pg.Result, _: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the energy balance: kinetic, potential, total, work and dissipated energy."""
    columns = (run.kinetic_energy, run.potential_energy, run.energy, run.work, run.dissipation)
    return ("kinetic", "potential", "total", "work", "dissipated"), np.stack(columns, axis=1)


def drifts(run: pg.Result, _: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the residuals of the constraints."""
    return ("position", "velocity"), run.constraint_drift


def moments(run: pg.Result, beam: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the bending and twisting moments of a beam next to its root."""
    first = f"{MOMENT}.{segment(beam, 1)}"
    found = {name: x for name, (_, x) in columns_of_beams(run).items() if name.startswith(first)}
    return [name[len(first) + 1 :] for name in found], np.stack(list(found.values()), axis=1)


def space_error(run: pg.Result, _: str) -> tuple[Sequence[str], np.ndarray]:
    """Return the estimated error of the segments of beams so far."""
    return ("",), run.space_error_at[:, None]


KINDS = {
    POSES: Kind("poses", "", lambda run, _: ((), np.zeros((len(run.t), 0)))),
    "q": Kind("joint position", "rad, m, 1", joint("q", "q")),
    "v": Kind("joint velocity", "rad/s, m/s", joint("v", "v")),
    "vdot": Kind("joint acceleration", "rad/s², m/s²", joint("vdot", "v")),
    "position": Kind("position", "m", body("body_pose", 0)),
    "velocity": Kind("velocity", "m/s", body("body_velocity", 3)),
    "spin": Kind("angular velocity", "rad/s", body("body_velocity", 0)),
    "acceleration": Kind("acceleration", "m/s²", body("body_acceleration", 3)),
    "angular_acceleration": Kind("angular acceleration", "rad/s²", body("body_acceleration", 0)),
    "joint_force": Kind("joint force", "N", body("joint_force", 3)),
    "joint_torque": Kind("joint torque", "N m", body("joint_force", 0)),
    "energy": Kind("energy", "J", energies),
    "drift": Kind("constraint drift", "m, m/s", drifts),
    "moment": Kind("moment at the root of", "N m", moments),
    "space_error": Kind("error in space", "m", space_error),
    "constraint_force": Kind("force of", "N", named("constraint_force", 3)),
    "constraint_torque": Kind("torque of", "N m", named("constraint_force", 0)),
    "pressure_angle": Kind("pressure angle of", "rad", of_cam("pressure_angle")),
    "normal_force": Kind("normal force of", "N", of_cam("normal_force")),
    "drive_force": Kind("torque or force of", "N m, N", single("drive_force")),
    "tension": Kind("tension of", "N", single("tension")),
    "path_length": Kind("length of", "m", single("path_length")),
    "limit": Kind("torque or force of the", "N m, N", limit),
    "contact_force": Kind("contact force of", "N", named("contact_force", 3)),
    "contact_gap": Kind("gap of", "m", single("contact_gap")),
    "contact_slip": Kind("slip of", "m/s", single("contact_slip")),
    "output": Kind("reading of", "of its kind", reading),
    "state": Kind("", "of its kind", state_of),
}  # fmt: skip
OF_BODIES = (
    "q", "v", "vdot", "position", "velocity", "spin", "acceleration", "angular_acceleration",
    "joint_force", "joint_torque",
)  # fmt: skip


NOUNS = {
    "constraint_force": ("constraint",), "pressure_angle": ("cam",), "normal_force": ("cam",),
    "contact_force": ("contact",), "drive_force": ("drive",),
    "tension": ("path",), "path_length": ("path",),
}  # fmt: skip
OF_PATHS = ("tension", "path_length")
PER = {"q": "", "v": "/s", "vdot": "/s²"}
OF_JOINTS = tuple(PER)
SI = Display()


def of_body(model: pg.Model, name: str) -> list[Signal]:
    """Return the available signals for a body."""
    moves = model.body(name).dof > 0
    found = [Signal(kind, name) for kind in OF_BODIES if moves or kind not in OF_JOINTS]
    return [*found, *([Signal("moment", name)] if name in model.segments else [])]


def of_several(model: pg.Model, names: Sequence[str]) -> list[Signal]:
    """Return signals that combine several bodies, with one component of each."""
    moving = [name for name in names if model.body(name).dof]
    found = []
    for kind in OF_BODIES:
        some = moving if kind in OF_JOINTS else names
        if some:
            component = "1" if kind in OF_JOINTS else XYZ[-1]
            found.append(Signal(f"{kind}.{component}", MANY.join(some)))
    return found


def components(run: pg.Result, signal: Signal) -> list[str]:
    """Return the components available in a chart of several bodies."""
    if not signal.component:
        return []
    found: list[str] = []
    for name in signal.bodies:
        try:
            labels, _ = KINDS[signal.quantity].read(run, name)
        except (KeyError, pg.PgraphError):
            continue
        found += [label for label in labels if label not in found]
    return found


def strip(run: pg.Result, travels: np.ndarray | float = 0.0) -> list[tuple[float, str]]:
    """Return (time, SVG text) for pictures evenly spaced over a run, as in Fig. 10 of the paper.

    `travels` is 1 along each axis on which the pictures follow the bodies, else 0.
    """
    times = np.linspace(float(run.t[0]), float(run.t[-1]), STRIP if len(run.t) > 1 else 1)
    poses = [between(np.asarray(run.t), np.asarray(run.body_pose), float(t)) for t in times]
    placed = [(at - travels * at.mean(axis=0), to_matrix(wxyz)) for at, wxyz in poses]
    return list(zip(times.tolist(), pictures(run.mechanism.model, placed, plain=True)))


def paths(run: pg.Result) -> list[list[str]]:
    """Return the names of each path in `run.tension`, all segments of a cable or rope together."""
    model, found = run.mechanism.model, dict[str, list[str]]()
    known = {part.name for part in (*all_forces(run), *model.constraints)}
    for name in run.tension:
        found.setdefault(without_segment(name, known)[0], []).append(name)
    return list(found.values())


def of_scene(run: pg.Result) -> list[Signal]:
    """Return the signals of a run that do not belong to a body."""
    found = [Signal(POSES, SCENE), Signal("energy", SCENE)]
    if run.constraint_force:
        found.append(Signal("drift", SCENE))
    if len(run.space_error_at):
        found.append(Signal("space_error", SCENE))
    found += [Signal("moment", name) for name in run.mechanism.model.segments]
    kinds = {c.name: c.kind for c in run.mechanism.model.constraints}
    for name in run.constraint_force:
        found.append(Signal("constraint_force", name))
        if kinds.get(name) != "point":  # a point transmits no torque
            found.append(Signal("constraint_torque", name))
    for name in run.cams:
        found += [Signal("pressure_angle", name), Signal("normal_force", name)]
    found += [Signal("drive_force", name) for name in run.drive_force]
    found += [Signal(kind, MANY.join(names)) for names in paths(run) for kind in OF_PATHS]
    found += [Signal("limit", name) for name in run.contacts.limit]
    for name in run.contact_force:
        found += [Signal(kind, name) for kind in ("contact_force", "contact_gap", "contact_slip")]
    found += [Signal("state", name) for name in columns_of_states(run)]
    return [*found, *(Signal("output", output.name) for output in run.mechanism.model.outputs)]


def hits(run: pg.Result, signal: Signal) -> list[float]:
    """Return the times at which a joint hits its limit, for the torques that lack its impulse."""
    if signal.quantity not in ("limit", "joint_force", "joint_torque"):
        return []
    of = set(signal.bodies)
    return [e.t for e in run.contacts.events if e.before == FREE and of & {e.contact, e.body}]


def idle(run: pg.Result) -> set[str]:
    """Return the contacts that never touch during a run."""
    return {name for name, force in run.contact_force.items() if not np.any(force)}


def title(signal: Signal) -> str:
    """Return a title such as 'joint torque of knee'."""
    label = KINDS[signal.quantity].label
    if signal.of == SCENE:
        return label
    if signal.quantity == "state":
        return _title_of_states(signal.bodies)
    whole = {without_segment(name, ())[0] for name in signal.bodies}
    if signal.quantity in OF_PATHS and len(signal.bodies) > 1 == len(whole):
        return f"{label} {whole.pop()}"  # all segments of a cable
    if len(signal.bodies) > 1 or signal.component:
        first = signal.quantity in OF_JOINTS and signal.component == "1"
        which = "" if first else signal.component
        label = " ".join(filter(None, (label.removesuffix(" of"), which)))
        noun = NOUNS.get(signal.quantity, ("body", "bodies"))
        return f"{label} of {counted(len(signal.bodies), *noun)}"
    return f"{label} {signal.of}" if label.endswith(" of") else f"{label} of {signal.of}"


def _title_of_states(names: Sequence[str]) -> str:
    """Return a title such as 'activation of biceps', 'control speed' or 'state 2 of speed'."""
    word, _, of = names[0].partition(".")
    if len(names) > 1:
        return f"{word} of {counted(len(names), 'muscle')}"
    if word != VALUE:
        return f"{word} of {of}"
    name, _, k = of.rpartition(".")
    return f"state {k} of {name}" if name and k.isdigit() else f"control {of}"


def units(model: pg.Model, signal: Signal, name: str) -> list[str]:
    """Return the SI unit of each column of a signal of one part, or one unit for all columns.

    Raises PgraphError if the model lacks the part.
    """
    what = signal.quantity
    if what == "output":
        output = model.part(name, kind="output")
        if output.kind not in OF_JOINT:
            return [output.reading.unit]
        motions = model.body(output.at).sequence
        found = [unit for motion in motions for unit in joints.units_of(motion)[1]]
        return [found[output.coordinate] + "/s" * (output.kind == "joint_velocity")]
    if what == "state":
        quantities = [own.quantity for _, _, own in model.states if own.quantity is not None]
        return [{q.word: q.unit for q in quantities}.get(name.partition(".")[0], "1")]
    if what == "drive_force":
        known = units_of_drives(model, known_forces(model))
        return known.get(name, KINDS[what].unit).split(", ")
    if what not in OF_JOINTS:
        return KINDS[what].unit.split(", ")
    own = [joints.units_of(motion)[what != "q"] for motion in model.body(name).sequence]
    return [unit + PER[what] for units in own for unit in units]


def unit(model: pg.Model, signal: Signal, display: Display = SI) -> str:
    """Return the units of a signal's columns as a page displays them, such as "deg/s, m/s"."""
    found: dict[str, None] = {}
    for name in signal.bodies:
        try:
            found |= dict.fromkeys(display.of_unit(x)[0] for x in units(model, signal, name))
        except pg.PgraphError:
            continue
    return ", ".join(found)


def curves(run: pg.Result, signal: Signal, display: Display = SI) -> list[Curve]:
    """Return the lines for a signal in the page's units, or [] if the run lacks it."""
    found: list[Curve] = []
    for name in signal.bodies:
        try:
            labels, columns = KINDS[signal.quantity].read(run, name)
            each = units(run.mechanism.model, signal, name)
            if signal.quantity in OF_JOINTS and not signal.component:
                labels = motions(run.mechanism.model.body(name), labels)
        except (KeyError, pg.PgraphError):
            continue
        many = signal.component or len(signal.bodies) > 1
        for i in range(columns.shape[1]):
            if signal.component in ("", labels[i]):
                shown_in, factor = display.of_unit(each[i % len(each)])
                label = name if many else labels[i]
                found.append(thinned(label, np.asarray(run.t), columns[:, i] * factor, shown_in))
    return found


def motions(body: pg.Body, labels: Sequence[str]) -> Sequence[str]:
    """Return the columns of a joint, named by motion, or by number for quaternions."""
    found = [label for label, _ in degrees(body)]
    return found if len(found) == len(labels) else labels


def thinned(label: str, t: np.ndarray, y: np.ndarray, unit: str = "") -> Curve:
    """Downsample a line to at most 2 POINTS points, preserving the extremes of each interval."""
    keep = np.isfinite(y)
    t, y = t[keep], y[keep]
    if len(t) > 2 * POINTS:
        edges = np.linspace(0, len(t), POINTS + 1).astype(int)[:-1]
        order: list[Any] = []
        for a, b in zip(edges, [*edges[1:], len(t)]):
            order += sorted({a + int(y[a:b].argmin()), a + int(y[a:b].argmax())})
        some = np.array(sorted({0, *order, len(t) - 1}))
        t, y = t[some], y[some]
    return Curve(label, t.tolist(), y.tolist(), unit)


@dataclass(frozen=True)
class Client(state.Client):
    plots: tuple[tuple[str, str], ...] = ()  # (quantity, of what), in their order

    def afresh(self) -> Self:
        return replace(super().afresh(), plots=())

    def followed(self, old: pg.Model, new: pg.Model, names: Names) -> Self:
        plots = tuple(
            (kind, MANY.join(names.get(("bodies", name), name) for name in of.split(MANY)))
            for kind, of in self.plots
        )
        return replace(super().followed(old, new, names), plots=plots)


@dataclass(frozen=True)
class State(run.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


# -- the selection of plotted signals on each page (pure) ------------------------------------------


MOST_PLOTS = 12
MOST_REPLOTTED = 100  # at once


class Plot(FromPage):
    """Toggle the plot of a signal: the quantity `kind` of the body or constraint `of`."""

    kind: Text
    of: Text
    on: bool

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or Signal(self.kind, self.of).quantity not in KINDS:
            return state
        signal = Signal(self.kind, self.of)
        rest = tuple(plot for plot in page.plots if plot != signal)
        plots = (*rest, signal)[-MOST_PLOTS:] if self.on else rest
        return with_client(state, self.client, plots=plots)


class Replot(FromPage):
    """Replace some plots, each (quantity, of what), with others."""

    off: Annotated[tuple[tuple[Text, Text], ...], Field(max_length=MOST_REPLOTTED)]
    on: Annotated[tuple[tuple[Text, Text], ...], Field(max_length=MOST_REPLOTTED)]

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or any(Signal(*plot).quantity not in KINDS for plot in self.on):
            return state
        rest = [plot for plot in page.plots if plot not in self.off and plot not in self.on]
        return with_client(state, self.client, plots=(*rest, *self.on)[-MOST_PLOTS:])


class PlotComponent(FromPage):
    """Select another component in a chart of several bodies."""

    kind: Text
    of: Text
    component: Text

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        old = Signal(self.kind, self.of)
        if page is None or old not in page.plots or not old.component:
            return state
        new = Signal(f"{old.quantity}.{self.component}", old.of)
        plots = [new if plot == old else plot for plot in page.plots if plot != new or plot == old]
        return with_client(state, self.client, plots=tuple(plots))
