"""What a run leaves: states over time, energies, forces, cost, and how it ended."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FileError, Problem
from ..mechanism.bodies import BodyMotion, bodies_over, turned
from ..model import Force, Model
from ..model.files import write_atomic
from ..plan import Plan
from ..portable import Portable
from ..system import Array
from .contact_record import ContactRecord, Event

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Status(Enum):
    """How a run ended."""

    DONE = "the run reached its end"
    NOT_FINITE = "the motion stopped being finite"
    SINGULAR = "a joint moves nothing that has inertia about it"
    CANNOT_CLOSE = "the constraints cannot all be met"
    STEP_TOO_SMALL = "the step that the tolerance asks for fell below what time can resolve"
    TOO_MANY_STEPS = "the run took as many steps as it may"
    NOT_SOLVED = "the equations of an implicit step could not be solved"
    CHATTER = "contacts switch without end"
    CANCELLED = "the run was cancelled"

    @property
    def ok(self) -> bool:
        """Whether the run reached its end."""
        return self is Status.DONE


@dataclass(frozen=True)
class Result(Portable):
    """A run. Arrays have one row a recorded frame; a run that failed keeps what it computed."""

    mechanism: Mechanism
    status: Status
    message: str  # the status with its time, its body, and what to try
    t: Array  # (n,) [s]
    q: Array  # (n, nq)
    v: Array  # (n, nv)
    vdot: Array  # (n, nv)
    kinetic_energy: Array  # (n,) [J]
    potential_energy: Array  # (n,) [J], springs included
    work: Array  # (n,) [J] put in by motors, servos, given torques, wrenches, prescribed motions
    dissipation: Array  # (n,) [J] taken out by dampers and friction
    constraint_drift: Array  # (n, 2) largest |position| [m] and |velocity| [m/s] residual
    constraint_force: Mapping[str, Array]  # {name: (n, 6)} [torque, force] on `body` at `point`
    contacts: ContactRecord  # forces, gaps, slips of contacts; torques of joint limits
    counters: Mapping[str, int]  # steps, evaluations, projections, solver iterations, ...
    timing: Mapping[str, float]  # seconds a phase
    error_estimate: float  # largest |change of q| at the end against twice the step [rad, m]
    header: Mapping[str, Any]  # version, model hash, method, step, ...
    notices: tuple[str, ...] = field(default=())  # what a person should know

    @cached_property
    def plan(self) -> Plan:
        """What this scene needed, what it did not, and what that saved."""
        model, acting = self.mechanism.model, tuple(self.constraint_force)
        given = {"scenario": self.header.get("scenario"), "method": self.header["method"]}
        return Plan.of(model, acting=acting, **given)

    @property
    def left_out(self) -> tuple[str, ...]:
        """What this scene did not need and therefore did not run, a sentence each."""
        return self.plan.left_out

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """{touch: (n, 6)} [torque, force] on its body about its origin, world axes."""
        return self.contacts.force

    @property
    def contact_gap(self) -> Mapping[str, Array]:
        """{touch: (n,)} smallest gap [m]."""
        return self.contacts.gap

    @property
    def contact_slip(self) -> Mapping[str, Array]:
        """{touch: (n,)} fastest slip [m/s]."""
        return self.contacts.slip

    @property
    def contact_normal(self) -> Mapping[str, Array]:
        """{touch: (n,)} part of the force off the ground [N], in event-driven runs."""
        return self.contacts.normal

    @property
    def events(self) -> tuple[Event, ...]:
        """Changes of contact points and limits in event-driven runs; each prints as a sentence."""
        return self.contacts.events

    @property
    def phases(self) -> Mapping[str, Any]:
        """{point: (n,)} swing, weight acceptance, slip or stance; a limit: free or stop."""
        return self.contacts.phases

    @property
    def energy(self) -> Array:
        """(n,) total mechanical energy [J]."""
        return self.kinetic_energy + self.potential_energy

    @cached_property
    def energy_drift(self) -> float:
        """Largest |E - E0 - work + dissipation|, relative to the range of the energies."""
        if len(self.t) < 2:
            return 0.0
        ledger = self.energy - self.work + self.dissipation
        balance = ledger - ledger[0]
        parts = (self.kinetic_energy, self.potential_energy, self.work, self.dissipation)
        scale = max(float(np.ptp(part)) for part in parts)
        scale = max(scale, float(np.max(self.kinetic_energy)))
        worst = float(np.max(np.abs(balance)))
        return worst / scale if scale > 0 else worst

    @property
    def body_pose(self) -> Array:
        """(n, nb, 7) x y z [m], w x y z of every body frame, by number."""
        return self.body_motion.pose

    @property
    def body_velocity(self) -> Array:
        """(n, nb, 6) [angular, linear] of every body frame, world axes."""
        return self.body_motion.velocity

    @property
    def body_acceleration(self) -> Array:
        """(n, nb, 6) [angular, linear] of every body frame, world axes."""
        return self.body_motion.acceleration

    @property
    def joint_force(self) -> Array:
        """(n, nb, 6) [torque, force] that each joint passes on to its body, at its origin."""
        return self.body_motion.force

    @cached_property
    def body_motion(self) -> BodyMotion:
        """Poses, velocities, accelerations and joint forces, computed when first asked for."""
        return body_motion(self)

    # -- files -------------------------------------------------------------------------------

    def save(self, path: str | Path, /) -> None:
        """Write an `.npz`: the arrays, and a JSON header that holds the model."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        arrays |= {f"force:{name}": value for name, value in self.constraint_force.items()}
        arrays |= self.contacts.arrays()
        header = {
            "status": self.status.name,
            **{name: getattr(self, name) for name in SCALARS},
            "model": json.loads(self.mechanism.model.to_json()),
        }
        buffer = io.BytesIO()
        np.savez_compressed(buffer, header=np.array(json.dumps(header)), **arrays)
        write_atomic(path, buffer.getvalue())

    @classmethod
    def load(cls, path: str | Path, /) -> Result:
        """The run in an `.npz` written by `save`. Raises FileError."""
        from ..mechanism import Mechanism

        try:
            with np.load(Path(path), allow_pickle=False) as data:
                header = json.loads(str(data["header"]))
                arrays = {name: data[name] for name in ARRAYS}
                prefix = "force:"
                forces = {k.removeprefix(prefix): data[k] for k in data if k.startswith(prefix)}
                contacts = ContactRecord.of_arrays({k: data[k] for k in data})
        except (OSError, ValueError, KeyError) as error:
            text = f"holds no run: {error}; give a file written by Result.save"
            raise FileError(Problem(str(path), "", text)) from None
        model = Model.from_json(json.dumps(header.pop("model")), source=str(path))
        status = Status[header.pop("status")]
        header["notices"] = tuple(header["notices"])
        header.pop("left_out", None)  # of runs saved before it followed from the model
        return cls(
            Mechanism(model), status, constraint_force=forces, contacts=contacts, **header, **arrays
        )

    def to_csv(self) -> str:
        """Time, q, v, energies and constraint forces as CSV, units in the first line."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = {"t [s]": self.t, "kinetic energy [J]": self.kinetic_energy}
        columns["potential energy [J]"] = self.potential_energy
        positions, speeds = coordinates(self.mechanism)
        columns |= {f"q {place} [{unit}]": x for (place, unit), x in zip(positions, self.q.T)}
        for name, per, array in (("v", "/s", self.v), ("vdot", "/s^2", self.vdot)):
            columns |= {
                f"{name} {place} [{unit}{per}]": x for (place, unit), x in zip(speeds, array.T)
            }
        for name, force in self.constraint_force.items():
            columns |= {f"{name} F{axis} [N]": force[:, 3 + i] for i, axis in enumerate("xyz")}
        columns |= self.contacts.columns()
        writer.writerow(columns)
        writer.writerows(zip(*(c.tolist() for c in columns.values())))
        return text.getvalue()


ARRAYS = (
    "t",
    "q",
    "v",
    "vdot",
    "kinetic_energy",
    "potential_energy",
    "work",
    "dissipation",
    "constraint_drift",
)
SCALARS = ("message", "counters", "timing", "error_estimate", "header", "notices")


INTERNAL = ("gear", "motion", "velocity")  # act in joints, as motors do


def body_motion(run: Result) -> BodyMotion:
    """Body motion and joint forces of all frames from (q, v, v') and what acts on the bodies."""
    mech = run.mechanism
    states = (run.q, run.v, run.vdot)
    external = _loads(run)
    if run.contacts.wrench.size:
        external += run.contacts.wrench
    motion = bodies_over(mech.system, *states, external)
    if run.constraint_force:
        _add_constraint_wrenches(run, motion, external)
        motion = bodies_over(mech.system, *states, external)
    return motion


def _loads(run: Result) -> Array:
    """(n, nb, 6) what the forces of the model, its scenario and the call do on the bodies."""
    mech, name = run.mechanism, run.header.get("scenario")
    own = mech.model.forces + (mech.model.scenario(name).forces if name is not None else ())
    loads = mech.load_wrenches(own, run.t, run.q, run.v)
    for begin, end, given in run.header.get("forces", ()):
        force = Force.model_validate(given)
        acts = (run.t >= begin) & ((run.t < end) | (end >= run.t[-1]))
        loads[acts] += mech.load_wrenches((force,), run.t[acts], run.q[acts], run.v[acts])
    return loads


def coordinates(mech: Mechanism) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """(what, unit) of every entry of q and of v, by body and number: ("knee 0", "rad")."""
    units_q = {"rotate": ["rad"], "translate": ["m"], "ball": ["1"] * 4}
    units_q["free"] = ["m"] * 3 + ["1"] * 4
    units_v = {"rotate": ["rad"], "translate": ["m"], "ball": ["rad"] * 3}
    units_v["free"] = ["rad"] * 3 + ["m"] * 3
    found: tuple[list[tuple[str, str]], list[tuple[str, str]]] = ([], [])
    for name in mech.names:
        for entries, units in zip(found, (units_q, units_v)):
            each = [unit for m in mech.model.body(name).sequence for unit in units[m.kind]]
            entries += [(f"{name} {k}", unit) for k, unit in enumerate(each)]
    return found


def _add_constraint_wrenches(run: Result, motion: BodyMotion, out: Array) -> None:
    """Constraint forces as wrenches on the bodies, world axes at their origins (eq. (22))."""
    mech, position = run.mechanism, motion.pose[..., :3]
    for c in mech.model.constraints:
        if c.name not in run.constraint_force or c.kind in INTERNAL:
            continue
        wrench = run.constraint_force[c.name]
        point = mech.model.point_of(c)
        b = mech.topology.number(c.body) - 1
        place = position[:, b] + turned(motion.pose[:, b, 3:], np.asarray(point))
        for body, signed in ((c.body, wrench), (c.other, -wrench)):
            b = mech.topology.number(body) - 1
            if b >= 0:
                arm = place - position[:, b]
                out[:, b, :3] += signed[:, :3] + np.cross(arm, signed[:, 3:])
                out[:, b, 3:] += signed[:, 3:]
