"""Poses, motion and joint forces of the bodies in all frames of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..curves import Table
from ..dynamics.exerted import load_wrenches, rope_spans
from ..dynamics.scene import segments_of
from ..dynamics.states import BodyMotion, bodies_over, turned
from ..engine import layout as at
from ..forces import Driven, OnJoint
from ..model import Constraint, Force, Model, Rope
from ..model.cam import Cam
from ..model.expressions import wanted
from ..packing import Array
from ..signals.meaning import unit
from ..units import UNITS, J, Q
from .cams import cam_record

if TYPE_CHECKING:
    from ..mechanism import Mechanism


ALL = slice(None)


def body_poses(run: Any, rows: slice = ALL) -> Array:
    """Return body poses for these frames, (n, nb, 7). The poses do not depend on any forces."""
    system = run.mechanism.packed.system
    q, v, vdot = _states(run, rows)
    none = np.zeros((len(q), len(system.bodies_i) - 1, 6))
    return bodies_over(system, q, v, vdot, none).pose


def body_motion(run: Any) -> BodyMotion:
    """Compute body motion and joint forces of all frames from (q, v, v') and forces.

    With time stepping, the forces of contacts and constraints are those of the last step, as in v'.
    """
    return bodies_over(run.mechanism.packed.system, *_states(run), outer_wrenches(run))


def outer_wrenches(run: Any, rows: slice = ALL) -> Array:
    """Return the wrenches on the bodies that joints do not transmit, (n, nb, 6), for these frames.

    They are those of forces, contacts and constraints, in world axes at the bodies' origins. The
    term Φ_Tᵀ F_T of eq. (22) is their negative.
    """
    external = _loads(run, rows)
    if run.contacts.wrench.size:
        external += run.contacts.wrench[rows]
    if run.constraint_force:
        pulls = run.contacts.pull or run.constraint_force
        pulls = {name: pulls[name][rows] for name in pulls}
        states = body_poses(run, rows), run.q[rows]
        add_constraint_wrenches(run.mechanism, pulls, states, external)
    return external


OF_POINTS = ("position", "velocity", "acceleration")


def of_point(run: Any, kind: str, body: str, point: Array) -> Array:
    """Return the position, velocity or acceleration (n, 3) of a point (3,) of a body.

    The point is in body axes, and the result in world axes: p + r, v + ω × r, or
    a + α × r + ω × (ω × r).
    """
    pose = run.body_pose[body]
    arm = turned(pose[:, 3:], point)
    if kind == "position":
        return pose[:, :3] + arm
    motion, spin = getattr(run, f"body_{kind}")[body], run.body_velocity[body][:, :3]
    found = motion[:, 3:] + np.cross(motion[:, :3], arm)
    return found if kind == "velocity" else found + np.cross(spin, np.cross(spin, arm))


def _states(run: Any, rows: slice = ALL) -> tuple[Array, Array, Array]:
    """Return writable copies of q, v and v' for these frames, as required by the kernels."""
    return run.q[rows].copy(), run.v[rows].copy(), run.vdot[rows].copy()


def _loads(run: Any, rows: slice = ALL) -> Array:
    """Return the wrenches on bodies due to model, scenario and call forces, (n, nb, 6)."""
    mech, own = run.mechanism, acting(run)
    drives = tuple(f for f in own if isinstance(f, OnJoint))  # drives that expressions may use
    t, (q, v) = run.t[rows].copy(), run._with_states(rows)  # kernels need writable arrays
    loads = load_wrenches(mech.packed, own, t, q, v)
    for begin, end, given in run.header.get("forces", ()):
        force = Force.model_validate(given)
        acts = (t >= begin) & ((t < end) | (end >= run.t[-1]))
        loads[acts] += load_wrenches(mech.packed, (*drives, force), t[acts], q[acts], v[acts])
    return loads


def acting(run: Any) -> tuple[Force, ...]:
    """Return the forces of a run's model and scenario, with the inputs of the call."""
    model, name = run.mechanism.model, run.header.get("scenario")
    inputs = run.header.get("inputs", {})

    def driven(f: Force) -> Force:
        if not isinstance(f, Driven) or f.name not in inputs:
            return f
        x = inputs[f.name]
        return f.unchecked_copy({f.INPUT: Table(**x) if isinstance(x, dict) else x})

    own = model.forces + (model.scenario(name).forces if name is not None else ())
    return tuple(map(driven, own))


def units_of_drives(model: Model, forces: Iterable[Force]) -> dict[str, str]:
    """Return the unit of the torque or force of each motor, servo and actuator among `forces`."""
    bodies = {b.name: b for b in model.bodies}
    dims = {f.name: wanted(f, "torque", bodies) for f in forces if isinstance(f, OnJoint)}
    return {name: unit(dim) if dim is not None else UNITS[J / Q] for name, dim in dims.items()}


def all_forces(run: Any) -> tuple[Force, ...]:
    """Return the forces of a run's model, scenario and call."""
    given = (Force.model_validate(x) for _, _, x in run.header.get("forces", ()))
    return (*acting(run), *given)


def add_constraint_wrenches(
    mech: Mechanism, forces: Mapping[str, Array], states: tuple[Array, Array], out: Array
) -> None:
    """Add constraint forces as wrenches on the bodies, in world axes at origins (eq. (22)).

    `states` are the poses of the bodies and q.
    """
    bodies = Pushed(mech, forces, *states, out)
    for c in mech.model.constraints:
        c.onto(bodies)


class Pushed(NamedTuple):
    """The bodies onto which constraints apply their wrenches (n, nb, 6), in `out`."""

    mech: Mechanism
    forces: Mapping[str, Array]
    pose: Array
    q: Array
    out: Array

    def at_point(self, c: Constraint) -> None:
        """Add the wrench of a constraint at its point, and the opposite one on its other body."""
        if c.name not in self.forces:
            return
        wrench, position = self.forces[c.name], self.pose[..., :3]
        b = self.mech.topology.number(c.body) - 1
        place = position[:, b] + turned(
            self.pose[:, b, 3:], np.asarray(self.mech.model.point_of(c))
        )
        for body, signed in zip(c.pair, (wrench, -wrench)):
            b = self.mech.topology.number(body) - 1
            if b >= 0:
                arm = place - position[:, b]
                self.out[:, b, :3] += signed[:, :3] + np.cross(arm, signed[:, 3:])
                self.out[:, b, 3:] += signed[:, 3:]

    def on_cam(self, c: Cam) -> None:
        """Add the force of a cam at its contact, and the opposite one on the cam."""
        if c.name not in self.forces:
            return
        found = cam_record(c, self.mech, self.q, self.pose, self.forces[c.name])
        for name, sign in ((c.body, 1.0), (c.other, -1.0)):
            b = self.mech.topology.number(name) - 1
            self.out[:, b] += sign * found.wrench(self.pose[:, b, :3])

    def along_rope(self, c: Rope) -> None:
        """Add the tensions of a rope on the bodies along it."""
        blocks = self.mech.packed.blocks
        for own, k in segments_of(blocks, c.name):
            if own not in self.forces:
                continue
            spans, _ = rope_spans(self.mech.packed, k, self.q.copy())
            tension = np.einsum("nk,nk->n", self.forces[own][:, 3:], spans[:, 0, 6:])
            first, count = blocks.blocks_i[k, [at.B_STATION, at.B_STATIONS]].tolist()
            numbers = blocks.stations["body"][first : first + count].tolist()
            for a, b, span in zip(numbers, numbers[1:], spans.swapaxes(0, 1)):
                force = tension[:, None] * span[:, 6:]
                for number, place, signed in ((a, span[:, :3], force), (b, span[:, 3:6], -force)):
                    if number:
                        arm = place - self.pose[:, number - 1, :3]
                        self.out[:, number - 1, :3] += np.cross(arm, signed)
                        self.out[:, number - 1, 3:] += signed
