"""Quantities of a stepper at its present state: forces, gaps, energies and outputs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.states import Sensors, bodies_over, no_motion
from ..engine import motion as kernels
from ..forces import Force
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.forces import drive_forces
from ..packing.signals import values_of
from ..portable import Snapshots
from ..pulleys import segment_names
from ..result.bodies import add_constraint_wrenches
from ..result.cams import CamRecord, cam_record
from ..result.paths import of_cables, of_ropes
from ..result.records import OF_CONSTRAINTS, OF_DRIVES, OF_PATHS, ByTouch, Named
from .loop import Steps
from .recording import Recording

if TYPE_CHECKING:
    from .clearance import Clearance


class Readings(Snapshots):
    """The present state of a stepper, and all that is read from it."""

    mech: Mechanism
    _record: Recording
    _steps: Steps
    _q: Array
    _v: Array
    _x: Array
    _width: float
    _forces: tuple[Force, ...]
    _carriers: Ints  # numbers of the pairs of bodies that forces act on
    _recording = False  # whether frames of a result are recorded
    _looked = False  # whether the only frame is the present state

    @property
    def t(self) -> float:
        """Time [s]."""
        return float(self._steps.clock["time"])

    @property
    def q(self) -> Array:
        """The current configuration (nq,), as a read-only view.

        NumPy refuses `st.q[0] = 1`. To restart at other values, write `q = st.q.copy(); q[0] = 1;
        st.reset(q=q, v=st.v)`, since values that are not given are those of the initial state.
        """
        return self._q

    @property
    def v(self) -> Array:
        """The current velocity (nv,), as a read-only view."""
        return self._v

    @property
    def states(self) -> Array:
        """The current states (nx,) of the controls, as a read-only view."""
        return self._x

    @property
    def controls(self) -> Mapping[str, float]:
        """The current values of the controls, {control: value}."""
        state = np.array([self.t]), self._steps.q[None], self._steps.v[None]
        found = values_of(self.mech.model, self.mech.packed, self._forces, *state)
        return Named({name: float(x[0]) for name, x in found.items()}, "controls", "control")

    @property
    def vdot(self) -> Array:
        """The current acceleration (nv,), with the contact and limit forces of the last step."""
        return self._seen().out.vdot[0, : self.mech.nv].copy()

    @property
    def energy(self) -> tuple[float, float]:
        """The (kinetic, potential) energy, including springs [J]."""
        kinetic, potential = self._seen().out.energies[0, :2].tolist()
        return kinetic, potential

    @property
    def contact_force(self) -> Mapping[str, Array]:
        """Contact wrenches {contact pair: (6,) [torque, force]} on the body at its origin [N m, N],
        world axes.

        With time stepping, these are means over the last call of `step`. Two body names are
        accepted as well, as in `Result`.
        """

        def on_other(wrench: Array, a: str, b: str) -> Array:
            origins = (self.mech.pose(self._q, name)[0] for name in (a, b))
            arm = np.subtract(*origins)
            return -np.concatenate((wrench[:3] + np.cross(arm, wrench[3:]), wrench[3:]))

        found = self._touches(
            lambda pair: np.concatenate((pair["mean_torque"], pair["mean_force"]))
        )
        return ByTouch(found, "contact_force", self.mech.model, sum, on_other)

    @property
    def contact_gap(self) -> Mapping[str, float]:
        """Minimum gaps {contact pair: gap} [m] at the present state, negative for penetration."""
        return ByTouch(self._gaps(), "contact_gap", self.mech.model, min)

    def _gaps(self) -> dict[str, float]:
        """Return the gaps of contact pairs at the present state of the run."""
        contacts = self._record.plan.contacts
        if contacts is None:
            return {}
        found = self._clearance.gaps(self._record.scene, self._steps.q[None], len(contacts.touches))
        return {touch.name: gap for touch, gap in zip(contacts.touches, found[0].tolist())}

    @cached_property
    def _clearance(self) -> Clearance:
        from .clearance import Clearance

        assert self._record.plan.contacts is not None
        return Clearance(self.mech, self._record.plan.contacts)

    @property
    def constraint_force(self) -> Mapping[str, Array]:
        """Constraint wrenches {constraint: (6,)} on `body` at `point` [N m, N], world axes.

        With time stepping, these are means over the last call of `step`.
        """
        record = self._seen()
        wrenches = record.out.wrenches[0, :, -kernels.MEANS :].copy()
        return Named(record.scene.forces(wrenches), *OF_CONSTRAINTS)

    @property
    def cams(self) -> Mapping[str, CamRecord]:
        """The contact of each cam: numbers `pressure_angle` and `normal_force`, as in `Result`."""
        forces = self.constraint_force
        out = self._seen().out
        q, none = out.q[:1, : self.mech.nq], np.zeros((1, self.mech.nb, 6))
        pose = bodies_over(self.mech.packed.system, out.q[:1], out.v[:1], out.vdot[:1], none).pose
        each = {c.name: cam_record(c, self.mech, q, pose, forces[c.name][None])
                for c in self.mech.model.cams if c.name in forces}  # fmt: skip
        found = {name: CamRecord(*(x[0] for x in one)) for name, one in each.items()}
        return Named(found, "cams", "cam")

    @property
    def drive_force(self) -> Mapping[str, float]:
        """The current {drive: torque or force} of motors, servos and actuators [N m, N].

        As in `Result`, they are within their limits and before the gear.
        """
        plan, state = self._record.plan, (self._steps.q[None], self._steps.v[None])
        found = drive_forces(plan.drives, plan.loads.signals, np.array([self.t]), *state)
        return Named(dict(zip(plan.driving, found[0].tolist())), *OF_DRIVES)

    @property
    def tension(self) -> Mapping[str, float]:
        """Current tensions {name: N} of springs, struts, cables and ropes, negative if they push.

        As in `Result`, a cable or rope has an entry "name[k]" for each of several segments. Those
        of ropes, and of cables that do not stretch, are means over the last call of `step`.
        """
        q, packed, found = self._steps.q[None, : self.mech.nq].copy(), self.mech.packed, {}
        scene = self._seen().scene
        rows = np.zeros((sum(len(own) for _, own in self._path_rows), 3))
        if len(rows):
            kernels.load_tensions(scene.address, self.t, self._steps.q, self._steps.v, rows)
        for name, own in self._path_rows:
            pulls = rows[own.start : own.stop, 0].tolist()
            found |= dict(zip(segment_names(name, len(own)), pulls))
        forces = {name: x[None] for name, x in self.constraint_force.items()}
        paths = of_ropes(packed, forces, q) if forces else ()
        found |= {name: float(path.tension[0]) for name, path in paths}
        if (contacts := self._record.plan.contacts) is not None and contacts.cables:
            pulls = self._record.out.pairs["mean_force"][0, len(contacts.touches) :, :1]
            limits = dict(zip(contacts.limits, pulls))
            found |= {name: float(x.tension[0]) for name, x in of_cables(packed, limits, q)}
        return Named(found, *OF_PATHS)

    @cached_property
    def _path_rows(self) -> list[tuple[str, range]]:
        """The name and the rows of each force along a path."""
        return self.mech.packed.placed().path_rows(self._record.plan.acting)

    @property
    def outputs(self) -> Mapping[str, Any]:
        """Readings {output: value}, each a number or an array (3,) or (4,). See `Output`."""
        out, sensors = self._seen().out, self._sensors
        states = out.q[:1], out.v[:1], out.vdot[:1]
        motion = no_motion(1)
        if sensors.moves:
            external = self._on_bodies() if sensors.loads else self._no_loads
            motion = bodies_over(self.mech.packed.system, *states, external)
        read = sensors.read(*states[:2], motion, self.pushes)[0]
        return Named(sensors.by_name(read), "outputs", "output")

    @property
    def pushes(self) -> Array:
        """Wrenches of contacts on bodies (1, nb, 6) at the state, or empty without contacts."""
        return self._seen().out.pushes[:1]

    @cached_property
    def _sensors(self) -> Sensors:
        return Sensors(self.mech.packed, self.mech.model)

    @cached_property
    def _no_loads(self) -> Array:
        return np.zeros((1, self.mech.nb, 6))

    def look_again(self) -> None:
        """Evaluate forces again when they are next read, after a change of the run's memory."""
        vars(self)["_looked"] = False

    def _on_bodies(self) -> Array:
        """Return the wrenches on bodies from forces, contacts and constraints at the state, (1, nb,
        6)."""
        record, packed = self._seen(), self.mech.packed
        external, out = np.zeros((1, self.mech.nb, 6)), record.out
        if len(self._carriers):
            state = self.t, out.q[0], out.v[0], external[0]
            kernels.load_wrenches(record.scene.address, *packed.system[2:4], *state)
        if out.pushes.size:
            external += out.pushes[:1]
        if record.scene.active[0]:
            states = out.q[:1], out.v[:1], out.vdot[:1]
            forces = record.scene.forces(out.wrenches[0, :, : kernels.MEANS])
            pose = bodies_over(packed.system, *states, external).pose
            each = {name: wrench[None] for name, wrench in forces.items()}
            q = out.q[:1, : self.mech.nq]
            add_constraint_wrenches(self.mech, each, (pose, q), external)
        return external

    def _open(self) -> None:
        """Continue without scheduled frames."""
        self._steps.open_ended(self._width)
        self._recording, self._looked = False, False

    def _seen(self) -> Recording:
        """Return the recording with the present state as its only frame."""
        if self._recording:
            self._open()
        if not self._looked:
            self._record.look()
            self._looked = True
        return self._record

    def _touches(self, value: Any) -> dict[str, Any]:
        plan = self._record.plan
        if plan.contacts is None:
            return {}
        pairs = self._seen().out.pairs[0]
        return {touch.name: value(pair) for touch, pair in zip(plan.contacts.touches, pairs)}
