"""Equality constraints, actuators, tendons, sites, sensors and keyframes in an MJCF file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import choices, needed, shown
from ..fields import GROUND, name_problem
from ..model import (
    Actuator,
    Constraint,
    Coupling,
    Drag,
    Force,
    Gear,
    Motion,
    Motor,
    Output,
    Scenario,
    Servo,
    Site,
    SpeedServo,
    Spring,
    Tendon,
    Wrench,
)
from ..model.output import Kind
from ..rotation import matrix, multiply, unit
from ..tolerances import SOLVED
from .conversion import NO_LIMIT, suspect_rings, unused
from .mjcf_compiled import MINVAL, Reading

Array = np.ndarray
CONNECT, WELD, JOINT, TENDON = 0, 1, 2, 3  # mjtEq
ALONG_JOINT, SITE = 1, 3  # mjtWrap
ON_JOINT, ON_TENDON = (0, 1), 3  # mjtTrn: (joint, joint in parent), tendon
INTEGRATOR, FILTERS = 1, (2, 3)  # mjtDyn: integrator, (filter, filterexact)
INERTIAL, BODIES, GEOMS, SITES, CAMERAS = 1, 2, 5, 6, 7  # mjtObj: body, xbody, geom, site, camera
SENSORS: dict[str, Kind] = {  # kind of output for each sensor of MuJoCo
    "jointpos": "joint_position", "jointvel": "joint_velocity", "framepos": "position",
    "framequat": "rotation", "framelinvel": "velocity", "frameangvel": "angular_velocity",
    "velocimeter": "velocimeter", "gyro": "gyro", "accelerometer": "accelerometer",
    "force": "force", "torque": "torque",
}  # fmt: skip
GROUPS = 31  # number of actuator groups that MuJoCo can switch off, 0 to 30


class Sums(dict[int, float]):
    """The coefficients in a sum of coordinates, by joint."""


class Parts:
    """The parts of a model other than the bodies."""

    def __init__(self, reader: Reading):
        self.reader, self.m, self.report = reader, reader.m, reader.report
        self.obey_flags()

    def obey_flags(self) -> None:
        """Remove everything that the global flags in the file disable."""
        m = self.m
        flags = {
            "LIMIT": ("jnt_limited", "tendon_limited"),
            "FRICTIONLOSS": ("dof_frictionloss", "tendon_frictionloss"),
            "SPRING": ("jnt_stiffness", "tendon_stiffness"),
            "DAMPER": ("dof_damping", "tendon_damping"),
            "EQUALITY": ("eq_active0",),
            "CONTACT": ("geom_contype", "geom_conaffinity", "pair_dim"),
        }
        bits = needed("mujoco", "mjcf").mjtDisableBit
        everything = bool(m.opt.disableflags & bits.mjDSBL_CONSTRAINT)
        for name, arrays in flags.items():
            of_constraints = name in ("LIMIT", "FRICTIONLOSS", "EQUALITY", "CONTACT")
            bit = int(getattr(bits, f"mjDSBL_{name}", 0))
            if m.opt.disableflags & bit or (everything and of_constraints):
                for array in arrays:
                    getattr(m, array)[:] = 0
                text = f"the file switches off: {name.lower()}"
                self.report.add("converted", self.reader.path.name, text)
        if m.opt.enableflags & int(needed("mujoco", "mjcf").mjtEnableBit.mjENBL_OVERRIDE):
            sliding, _, spinning, rolling, _ = m.opt.o_friction
            m.geom_friction[:] = (sliding, spinning, rolling)
            m.pair_friction[:] = m.opt.o_friction
            text = "the file overrides the friction of all geoms by o_friction"
            self.report.add("converted", self.reader.path.name, text)
        self.filters = not m.opt.disableflags & int(bits.mjDSBL_FILTERPARENT)
        self.driven = not m.opt.disableflags & int(bits.mjDSBL_ACTUATION)
        self.actuators = len(m.actuator_trnid)
        if self.actuators and not self.driven:
            text = (
                f"the file switches off: actuation, so its {self.actuators} actuators are left out"
            )
            self.report.add("left out", self.reader.path.name, text)

    # -- equalities ------------------------------------------------------------------------------

    def constraints(self) -> list[Constraint]:
        """Return the constraints from connect, weld, joint and tendon equalities."""
        found: list[Constraint] = []
        taken: set[str] = set()
        for e in range(self.m.neq):
            name = unused(self.m.equality(e).name or f"equality {e + 1}", taken)
            taken.add(name)
            kind = int(self.m.eq_type[e])
            one = None
            if kind == JOINT:
                one = self._follows(e, name)
            elif kind in (CONNECT, WELD):
                one = self._tied(e, name, kind)
            elif kind == TENDON:
                one = self._tendon_held(e, name)
            else:
                text = "an equality of flexible bodies or distances"
                self.reader.left_out("equality", name, text, acts=bool(self.m.eq_active0[e]))
            if one is not None:
                found.append(one)
        gears = (c for c in found if isinstance(c, Gear) and c.active)
        suspect_rings(self.report, ((c, self.reader.where("joint", c.name)) for c in gears))
        return found

    def _follows(self, e: int, name: str) -> Constraint | None:
        m, data = self.m, self.m.eq_data[e]
        follower, leader = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        body, coordinate = self.reader.place_of_joint[follower]
        active = bool(m.eq_active0[e])
        if np.any(data[2:5]) and leader >= 0:
            text = "a joint that follows another by a curve, not by a line"
            self.reader.left_out("joint", name, text, acts=active)
            return None
        if leader < 0 or data[1] == 0:
            held = {"kind": "polynomial", "coefficients": [float(data[0])]}
            return Motion(name=name, body=body, coordinate=coordinate, q_of_t=held, active=active)
        other, k = self.reader.place_of_joint[leader]
        return Gear(
            name=name, body=body, coordinate=coordinate, other=other, other_coordinate=k,
            ratio=float(data[1]), offset=float(data[0]), active=active,
        )  # fmt: skip

    def _tendon_held(self, e: int, name: str) -> Constraint | None:
        """Return the constraint of a tendon that keeps its length or follows another linearly."""
        m, data = self.m, self.m.eq_data[e]
        one, two = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        total = self._along_joints(one)
        other = self._along_joints(two) if two >= 0 else Sums()
        if total is None or other is None or (two >= 0 and np.any(data[2:5])):
            text = "an equality of a tendon that is not along joints, or by a curve"
            self.reader.left_out("equality", name, text, acts=bool(m.eq_active0[e]))
            return None
        for j, x in other.items():
            total[j] = total.get(j, 0.0) - float(data[1]) * x
        return Coupling(
            name=name, coefficients=self._rows(total), value=float(data[0]),
            active=bool(m.eq_active0[e]),
        )  # fmt: skip

    def _along_joints(self, t: int) -> Sums | None:
        """Return the coefficients of a fixed tendon, or None for a spatial tendon."""
        m, first = self.m, int(self.m.tendon_adr[t])
        parts = range(first, first + int(m.tendon_num[t]))
        if any(m.wrap_type[w] != ALONG_JOINT for w in parts):
            return None
        found = Sums()
        for w in parts:
            j = int(m.wrap_objid[w])
            found[j] = found.get(j, 0.0) + float(m.wrap_prm[w])
        return found

    def _rows(self, sums: Sums) -> dict[str, list[float]]:
        """Convert coefficients by joint to rows by body."""
        found: dict[str, list[float]] = {}
        for j, x in sums.items():
            body, k = self.reader.place_of_joint[j]
            found.setdefault(body, [0.0] * self.reader.freedoms[body])[k] += x
        return found

    def _length(self, sums: Sums) -> float:
        """Return the length of a tendon in the file's initial pose, where q is zero here."""
        return sum(x * float(self.m.qpos0[self.m.jnt_qposadr[j]]) for j, x in sums.items())

    def _tied(self, e: int, name: str, kind: int) -> Constraint | None:
        m, data, site = self.m, self.m.eq_data[e], self.m.eq_objtype[e] == 6  # mjOBJ_SITE
        one, two = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        turn = (1.0, 0.0, 0.0, 0.0)
        if site:
            first, second = m.site_pos[one], m.site_pos[two]
            turn = _relative(m.site_quat[one], m.site_quat[two])
            one, two = int(m.site_bodyid[one]), int(m.site_bodyid[two])
        elif kind == CONNECT:
            first, second = data[0:3], data[3:6]
        else:
            turn = unit(data[6:10].tolist())
            first, second = data[3:6], data[0:3]  # the reverse of the order of a connect
        pivot, names = self.reader.pivot, self.reader.names
        ends = [(names[one], first - pivot[one]), (names[two], second - pivot[two])]
        if ends[0][0] == GROUND:
            ends.reverse()
        (body, point), (other, other_point) = ends
        if kind == WELD and not self._as_at_first(one, two, turn):
            text = (
                "the orientation of a weld that is not met at first: it holds the one at first here"
            )
            self.reader.left_out("weld", name, text, acts=bool(m.eq_active0[e]))
        return Constraint(
            name=name, kind="weld" if kind == WELD else "point", body=body, other=other,
            point=tuple(point.tolist()), other_point=tuple(other_point.tolist()),
            active=bool(m.eq_active0[e]),
        )  # fmt: skip

    def _as_at_first(self, one: int, two: int, turn: Any) -> bool:
        R = self.m.home.xmat.reshape(-1, 3, 3)
        return bool(np.abs(R[one].T @ R[two] - matrix(turn)).max() < 1e-6)

    # -- actuators -------------------------------------------------------------------------------

    def forces(self) -> Iterator[Force]:
        """Yield actuators as motors and servos, and gravity compensation as wrenches.

        Names in MuJoCo are unique per kind of element. The later of two elements with one name is
        renamed.
        """
        taken: set[str] = set()
        for one in self._forces():
            name = unused(one.name, taken)
            taken.add(name)
            if name != one.name:
                text = f"is named {shown(name)} here: another force has its name"
                self.report.add("converted", self.reader.path.name, f"{shown(one.name)} {text}")
            yield one if name == one.name else one.model_copy(update={"name": name})

    def _forces(self) -> Iterator[Force]:
        for a in range(self.actuators if self.driven else 0):
            name = self.m.actuator(a).name or f"actuator {a + 1}"
            if self._switched_off(a, name):
                continue
            if (one := self._actuator(a, name)) is not None:
                yield one
        yield from self._tendons()
        yield from self._drags()
        yield from self._lifts()

    def _channel(self, a: int) -> tuple[int, int]:
        """Return the rows for the output and input of an actuator in MuJoCo's tables."""
        m = self.m
        if not hasattr(m, "actuator_outadr"):  # before MuJoCo 4 each actuator has one of both
            return a, a
        return int(m.actuator_outadr[a]), int(m.actuator_ctrladr[a])

    def _several(self, a: int) -> str:
        """Return a message if an actuator does not have exactly one input and one output."""
        m = self.m
        inputs, outputs = (
            int(table[a]) if (table := getattr(m, f"actuator_{word}num", None)) is not None else 1
            for word in ("ctrl", "out")
        )
        if inputs == outputs == 1:
            return ""
        return f"an actuator with {inputs} inputs and {outputs} outputs, not one of each"

    def _lifts(self) -> Iterator[Wrench]:
        """Yield gravity compensation as wrenches at the centres of mass of its bodies."""
        m, lifted = self.m, list[str]()
        for b in np.flatnonzero(m.body_gravcomp):
            name = self.reader.names[b]
            lift = -self.reader.gravity * m.body_mass[b] * m.body_gravcomp[b]
            if not np.any(lift):
                continue
            if not self.actuators or not self.driven:
                idle = [bool(m.jnt_actgravcomp[j]) for j in self._joints_above(int(b))]
                if any(idle):
                    text = "actuatorgravcomp, which has no effect without an actuator"
                    if not all(idle):
                        text = "gravcomp of joints of which some have actuatorgravcomp, with no "
                        text += "actuator that acts"
                    where = m.body(int(b)).name
                    self.reader.left_out("body", where, text, acts=not all(idle))
                    continue
            lifted.append(name)
            point = m.body_ipos[b] - self.reader.pivot[b]
            yield Wrench(
                name=f"gravcomp of {name}", body=name, force=tuple(lift.tolist()),
                point=tuple(point.tolist()),
            )  # fmt: skip
        if lifted:
            text = (
                f"gravcomp of {choices(map(shown, lifted))}: wrenches, which act in runs, in "
                "`linearise` and in `equilibrium`; not in `constrained_dynamics`, nor in "
                "`forward_dynamics` and `inverse_dynamics`, which take them as `external`"
            )
            self.report.add("converted", self.reader.path.name, text)

    def _joints_above(self, b: int) -> Iterator[int]:
        """Yield the joints that move a body."""
        m = self.m
        while b:
            yield from range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
            b = int(m.body_parentid[b])

    def _switched_off(self, a: int, name: str) -> bool:
        """Report an actuator whose group is disabled in the file. Return False for others."""
        m, group = self.m, int(self.m.actuator_group[a])
        if not (0 <= group < GROUPS and int(m.opt.disableactuator) >> group & 1):
            return False
        text = f"an actuator of group {group}, which the file switches off (actuatorgroupdisable)"
        self.reader.left_out("actuator", name, text, acts=False)
        return True

    def _tendons(self) -> Iterator[Force]:
        """Yield the active tendons, both those along joints and straight ones between two sites."""
        m = self.m
        for t in range(m.ntendon):
            name = m.tendon(t).name or f"tendon {t + 1}"
            pulls = bool(m.tendon_stiffness[t]) or bool(m.tendon_damping[t])
            acts = pulls or m.tendon_frictionloss[t] or m.tendon_limited[t] or m.tendon_armature[t]
            if not acts:
                if t not in self._used_tendons():
                    text = "a tendon without spring, damper, friction, limits or actuator"
                    self.reader.left_out("tendon", name, text, acts=False)
                continue
            if (
                m.tendon_armature[t]
                or m.tendon_springyield[t]
                or any(
                    np.any(getattr(m, f"tendon_{x}poly", np.zeros(t + 1))[t])
                    for x in ("stiffness", "damping")
                )
            ):
                self.reader.left_out(
                    "tendon", name, "a tendon with armature, or not linear or elastic"
                )
                continue
            shortest, longest = (float(x) for x in m.tendon_lengthspring[t])
            if m.tendon_stiffness[t] and shortest != longest:
                self.reader.left_out("tendon", name, "a tendon with a slack range of its spring")
                continue
            sums = self._along_joints(t)
            made = self._straight(t, name) if sums is None else self._tendon(t, name, sums)
            if made is not None:
                yield made

    def _used_tendons(self) -> set[int]:
        """Return the tendons used by actuators and equalities."""
        m = self.m
        pulled = m.actuator_trnid[m.actuator_trntype == ON_TENDON, 0]
        held = m.eq_type == TENDON
        return {*pulled.tolist(), *m.eq_obj1id[held].tolist(), *m.eq_obj2id[held].tolist()}

    def _tendon(self, t: int, name: str, sums: Sums) -> Tendon:
        m, start = self.m, self._length(sums)
        limits = {key: end - start for key, end in self._ends(t, name).items()}
        return Tendon(
            name=name, coefficients=self._rows(sums), stiffness=float(m.tendon_stiffness[t]),
            damping=float(m.tendon_damping[t]), friction=float(m.tendon_frictionloss[t]),
            rest=float(m.tendon_lengthspring[t, 0]) - start, **limits,
        )  # fmt: skip

    def _ends(self, t: int, name: str) -> dict[str, Any]:
        """Return the minimum and maximum length of a tendon, or {} if it has no limits."""
        if not self.m.tendon_limited[t]:
            return {}
        low, high = (float(x) for x in self.m.tendon_range[t])
        margin = float(self.m.tendon_margin[t])
        low, high = within_margin(self.reader, "tendon", name, low, high, margin)
        found = {"low": low, "high": high}
        return {key: end for key, end in found.items() if abs(end) < NO_LIMIT}

    def _straight(self, t: int, name: str) -> Spring | None:
        """Return a spring for a straight tendon between two sites."""
        m, first = self.m, int(self.m.tendon_adr[t])
        straight = m.tendon_num[t] == 2 and all(m.wrap_type[first : first + 2] == SITE)
        if not straight or m.tendon_frictionloss[t]:
            text = "a tendon with friction" if straight else "a tendon around corners"
            self.reader.left_out("tendon", name, f"{text}, from site to site")
            return None
        ends: list[tuple[str, tuple[float, ...]]] = []
        for site in m.wrap_objid[first : first + 2]:
            b = int(m.site_bodyid[site])
            place = m.site_pos[site] - self.reader.pivot[b]
            ends.append((self.reader.names[b], tuple(place.tolist())))
        if ends[0][0] == GROUND:
            ends.reverse()
        (body, point), (other, other_point) = ends
        if body == other:
            return None
        return Spring(
            name=name, body=body, other=other, point=point, other_point=other_point,
            stiffness=float(m.tendon_stiffness[t]), damping=float(m.tendon_damping[t]),
            rest=float(m.tendon_lengthspring[t, 0]),
            **{key: end for key, end in self._ends(t, name).items() if key == "high" or end > 0},
        )  # fmt: skip

    def _actuator(self, a: int, name: str) -> Force | None:
        """Return the force of an actuator, gear x (gain u + b0 + b1 length + b2 rate)."""
        m, kind = self.m, int(self.m.actuator_trntype[a])
        target = int(m.actuator_trnid[a, 0])
        sums = self._moved(a)
        why = self._strange(a) if sums else "an actuator on a tendon that is not along joints"
        if sums is None or why:
            self.reader.left_out("actuator", name, why)
            return None
        output, control = self._channel(a)
        gear, gain = float(m.actuator_gear[output, 0]), float(m.actuator_gainprm[a, 0])
        affine = m.actuator_biastype[a] == 1
        b0, b1, b2 = (float(x) if affine else 0.0 for x in m.actuator_biasprm[a, :3])
        fields: dict[str, Any] = {"name": name, "gear": gear, **self._limits(a, sums, name)}
        if kind == ON_TENDON:
            fields["coefficients"] = self._rows(sums)
        else:
            fields["body"], fields["coordinate"] = self.reader.place_of_joint[target]
        low, high = self._range("ctrl", control)
        if low > -np.inf:
            fields |= {"input_low": low, "input_high": high}
        u = min(max(0.0, low), high)
        if m.actuator_dyntype[a] in FILTERS:
            fields["lag"] = float(m.actuator_dynprm[a, 0])
            fields |= {"start": 0.0} if u else {}
        if m.actuator_dyntype[a] == INTEGRATOR:
            fields |= {"integrates": True, **self._states(a)}
        torque = b0 + b1 * gear * self._length(sums)  # q here is 0 in the file's initial pose
        kp, kd = 0.0 - b1, 0.0 - b2
        if gain == 1 and torque == kp == kd == 0:
            return Motor(torque=u, **fields)
        if kp > 0 and kd >= 0 and gain == kp:
            return Servo(kp=kp, kd=kd, target=u, torque=torque, **fields)
        if kp == 0 and kd > 0 and gain == kd:
            return SpeedServo(kd=kd, speed=u, torque=torque, **fields)
        return Actuator(gain=gain, input=u, torque=torque, kp=kp, kd=kd, **fields)

    def _moved(self, a: int) -> Sums | None:
        """Return the joints of an actuator, or None if its length is no sum of coordinates."""
        target, kind = int(self.m.actuator_trnid[a, 0]), int(self.m.actuator_trntype[a])
        return self._along_joints(target) if kind == ON_TENDON else Sums({target: 1.0})

    def _range(self, word: str, row: int) -> tuple[float, float]:
        """Return the bounds on an actuator's "ctrl", "act" or "force", infinite without limits."""
        if not getattr(self.m, f"actuator_{word}limited")[row]:
            return -np.inf, np.inf
        low, high = getattr(self.m, f"actuator_{word}range")[row].tolist()
        return low, high

    def _states(self, a: int) -> dict[str, float]:
        """Return the bounds on the integrated input and its initial value."""
        low, high = self._range("act", a)
        if low == -np.inf:
            return {}
        start = min(max(0.0, low), high)
        return {"state_low": low, "state_high": high, **({"start": start} if start else {})}

    def _strange(self, a: int) -> str:
        """Return the reason why an actuator cannot be represented, or ""."""
        m = self.m
        if several := self._several(a):
            return several
        output, control = self._channel(a)
        if m.actuator_trntype[a] not in (*ON_JOINT, ON_TENDON):
            return "an actuator that does not act on a joint or tendon (on a site or body)"
        if m.actuator_trntype[a] != ON_TENDON and m.jnt_type[m.actuator_trnid[a, 0]] < 2:
            return "an actuator on a ball or free joint"
        if m.actuator_gear[output, 0] == 0:
            return "an actuator with gear 0"
        (low, high), (least, most) = self._range("ctrl", control), self._range("act", a)
        filtered = m.actuator_dyntype[a] in FILTERS
        if m.actuator_dyntype[a] not in (0, INTEGRATOR, *FILTERS):
            return "an actuator with a state of its own other than a filter or integral (muscle)"
        if filtered and (least > low or most < high):
            return "an actuator with a filter that has bounds of its own"
        if a in m.set_in("actuator_delay"):
            return "an actuator with a delay"
        if m.actuator_gaintype[a] != 0 or m.actuator_biastype[a] not in (0, 1):
            return "an actuator whose gain depends on the state"
        for key in ("actuator_armature", "actuator_damping", "actuator_dampingpoly"):
            if a in m.set_in(key):
                return "an actuator with armature or damping of its own"
        return ""

    def _limits(self, a: int, sums: Sums, name: str) -> dict[str, float]:
        """Return the minimum and maximum torque, before the gear."""
        m, (output, _) = self.m, self._channel(a)
        gear = float(m.actuator_gear[output, 0])
        low, high = self._range("force", a)
        shared = 0
        t = int(m.actuator_trnid[a, 0])
        if m.actuator_trntype[a] == ON_TENDON and m.tendon_actfrclimited[t]:
            ends = m.tendon_actfrcrange[
                t
            ]  # limits on the forces of its actuators before their gears
            low, high = max(low, float(ends[0])), min(high, float(ends[1]))
            same = (m.actuator_trntype == ON_TENDON) & (m.actuator_trnid[:, 0] == t)
            shared = max(shared, int(same.sum()))
        for j, x in sums.items():
            if not m.jnt_actfrclimited[j]:
                continue
            of_joint = [s for b in range(self.actuators) if j in (s := self._moved(b) or Sums())]
            if len(sums) == 1:
                ends = sorted(float(end) / (gear * x) for end in m.jnt_actfrcrange[j])
                low, high = max(low, ends[0]), min(high, ends[1])
                shared = max(shared, len(of_joint))
            elif len(of_joint) > 1 or not self._within(j, gear * x, (low, high)):
                text = f"the limit of what actuators give in joint {shown(m.joint(j).name)}"
                text += ", one of several along the actuator's tendon"
                self.reader.left_out("actuator", name, text)
        if shared > 1:
            text = "the limit of the sum of several actuators holds for each of them here"
            self.report.add("approximated", self.reader.where("actuator", name), text, part=name)
        if np.isinf(low) and np.isinf(high):
            return {}
        if low >= high or high <= 0 or np.isinf(high):
            text = f"a limit of its force, {low:g} to {high:g}, that leaves no force forwards"
            self.reader.left_out("actuator", name, text)
            return {}
        return {"torque_limit": high} if low == -high else {"torque_limit": high, "torque_low": low}

    def _within(self, j: int, factor: float, ends: tuple[float, float]) -> bool:
        """Return True if forces in these bounds, times a factor, stay within a joint's limit."""
        low, high = self.m.jnt_actfrcrange[j]
        return all(low <= factor * end <= high for end in ends)

    def _drags(self) -> Iterator[Drag]:
        """Yield the fluid drag on the bodies, modelled with MuJoCo's inertia boxes."""
        m = self.m
        if not (m.opt.density or m.opt.viscosity):
            return
        if np.any(m.opt.wind) or np.any(m.geom_fluid[:, 0]):
            text = "the fluid around the bodies, with wind or as ellipsoids"
            self.reader.left_out("option", "", text)
            return
        for b in range(1, m.nbody):
            if m.body_mass[b] < MINVAL or not m.body_dofnum[m.body_weldid[b]]:
                continue
            moments = m.body_inertia[b]
            squares = np.maximum(moments.sum() - 2 * moments, MINVAL) / m.body_mass[b] * 6
            yield Drag(
                name=f"fluid around {self.reader.names[b]}", body=self.reader.names[b],
                size=tuple(np.sqrt(squares).tolist()), rotation=unit(m.body_iquat[b].tolist()),
                point=tuple((m.body_ipos[b] - self.reader.pivot[b]).tolist()),
                density=float(m.opt.density), viscosity=float(m.opt.viscosity),
            )  # fmt: skip

    def sites(self, taken: list[str]) -> list[Site]:
        """Return the sites, renaming those that share a name with a body."""
        m, found = self.m, dict[str, Site]()
        tied = [m.tendon(t).name for t in range(m.ntendon)]
        tied += [m.equality(e).name for e in range(m.neq)]
        tied += [m.sensor(k).name for k in range(m.nsensor)]
        ends = {end_name(name, k) for name in tied for k in (1, 2)}
        self.frames: dict[int, str] = {}  # names of sites that outputs may use
        for s in range(m.nsite):
            name = m.site(s).name
            if name in ends:
                plain = np.allclose(m.site_pos[s], self.reader.pivot[m.site_bodyid[s]])
                if plain and np.allclose(m.site_quat[s], (1, 0, 0, 0)):
                    self.frames[s] = self.reader.names[m.site_bodyid[s]]
                continue
            name = f"site {s + 1}" if name_problem(name) else name
            name = f"{name} site" if name in taken or name == GROUND else name
            name = unused(name, {*found, *taken})
            b = int(m.site_bodyid[s])
            self.frames[s] = name
            found[name] = Site(
                name=name, body=self.reader.names[b], rotation=unit(m.site_quat[s].tolist()),
                point=tuple((m.site_pos[s] - self.reader.pivot[b]).tolist()),
            )  # fmt: skip
        return list(found.values())

    def outputs(self, sites: list[Site]) -> list[Output]:
        """Return the sensors on joints and frames as outputs. Those on bodies get new sites."""
        m, found = self.m, dict[str, Output]()
        kinds = needed("mujoco", "mjcf").mjtSensor
        others: dict[tuple[str, str], list[str]] = {}
        for k in range(m.nsensor):
            word = kinds(int(m.sensor_type[k])).name.removeprefix("mjSENS_").lower()
            name = m.sensor(k).name
            name = f"{word} {k + 1}" if name_problem(name) else name
            name = unused(name, found)
            why = "delayed" if k in m.set_in("sensor_delay") else ""
            why = why or "seen from another frame" * bool(m.sensor_refid[k] >= 0)
            if word not in SENSORS or why:
                others.setdefault((word, why), []).append(shown(name))
                continue
            fields = self._sensed(k, word, name, sites)
            found[name] = Output(name=name, kind=SENSORS[word], **fields)
            if m.sensor_cutoff[k] > 0:
                text = "its cutoff: it reads all values"
                self.reader.left_out("sensor", name, text, acts=False)
        for (word, why), names in others.items():
            text = f"of kind {word}{', ' * bool(why)}{why}: {choices(names, 6)}"
            self.reader.left_out("sensor", "", text, acts=False)
        return list(found.values())

    def _sensed(self, k: int, word: str, name: str, sites: list[Site]) -> dict[str, Any]:
        """Return the object of a sensor: a coordinate, a body, or a site, possibly new."""
        m, what = self.m, int(self.m.sensor_objid[k])
        if word in ("jointpos", "jointvel"):
            if m.qpos0[m.jnt_qposadr[what]] and word == "jointpos":
                text = "it counts from the file's initial pose here"
                self.report.add("converted", self.reader.where("sensor", m.sensor(k).name), text)
            body, coordinate = self.reader.place_of_joint[what]
            return {"at": body, "coordinate": coordinate}
        kind = int(m.sensor_objtype[k])
        if kind == SITES and what in self.frames:
            return {"at": self.frames[what]}
        tables = {
            SITES: (m.site_bodyid, m.site_pos, m.site_quat),
            GEOMS: (m.geom_bodyid, m.geom_pos, m.geom_quat),
            CAMERAS: (m.cam_bodyid, m.cam_pos, m.cam_quat),
            INERTIAL: (range(m.nbody), m.body_ipos, m.body_iquat),
        }
        b, point, turn = what, np.zeros(3), (1.0, 0.0, 0.0, 0.0)
        if kind in tables:
            owner, places, turns = tables[kind]
            b, point, turn = int(owner[what]), places[what], unit(turns[what].tolist())
        point = point - self.reader.pivot[b]
        if kind == BODIES and not np.any(point):
            return {"at": self.reader.names[b]}
        taken = {s.name for s in sites} | {*self.reader.names}
        own = unused(f"{name} frame", taken)
        sites.append(
            Site(name=own, body=self.reader.names[b], point=tuple(point.tolist()), rotation=turn)
        )
        return {"at": own}

    # -- keyframes and the rest ------------------------------------------------------------------

    def keyframes(self) -> list[Scenario]:
        """Return each keyframe as a scenario with its initial state."""
        found: list[Scenario] = []
        for k in range(self.m.nkey):
            name = unused(self.m.key(k).name or f"key {k + 1}", {s.name for s in found})
            q, v, beyond = self._state(self.m.key_qpos[k], self.m.key_qvel[k])
            if beyond:
                text = f"it starts beyond the limits of {', '.join(beyond)}, which hold it there"
                self.report.add("warning", self.reader.where("key", name), text)
            for given, text in (
                (self.m.key_ctrl[k], "its controls; a run takes them as inputs={name: value}"),
                (
                    self.m.key_act[k],
                    "its activations; `start` of a motor or servo is its initial value",
                ),
            ):
                if np.any(given):
                    self.reader.left_out("key", name, text, acts=False)
            if np.any(np.abs(self.m.key_mpos[k] - self._mocap()).max(initial=0.0) > SOLVED):
                text = "positions of mocap bodies"
                self.reader.left_out("key", name, text)
            found.append(Scenario(name=name, q=q, v=v))
        return found

    def _mocap(self) -> Array:
        """Return the positions of the mocap bodies as a (3 nmocap,) array."""
        m = self.m
        moved = sorted(np.flatnonzero(m.body_mocapid >= 0), key=lambda b: m.body_mocapid[b])
        return m.body_pos[moved].ravel()

    def _state(self, qpos: Array, qvel: Array) -> tuple[Any, Any, list[str]]:
        """Return (q, v) by body of a MuJoCo state, and the joints that it puts beyond limits."""
        m, q, v = self.m, dict[str, list[float]](), dict[str, list[float]]()
        beyond: list[str] = []
        for j in range(m.njnt):
            body, _ = self.reader.place_of_joint[j]
            at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
            kind, b = int(m.jnt_type[j]), int(m.jnt_bodyid[j])
            here, there = q.setdefault(body, []), v.setdefault(body, [])
            if kind == 0:
                turn = unit(qpos[at + 3 : at + 7].tolist())
                here += [*qpos[at : at + 3].tolist(), *turn]
                there += (matrix(turn) @ qvel[dof + 3 : dof + 6]).tolist()
                there += qvel[dof : dof + 3].tolist()
            elif kind == 1:
                first = self.reader.groups[b][0].name == body
                w, x, y, z = home = unit(m.body_quat[b].tolist()) if first else (1.0, 0.0, 0.0, 0.0)
                turn = multiply(home, multiply(unit(qpos[at : at + 4].tolist()), (w, -x, -y, -z)))
                here += turn
                there += (matrix(turn) @ matrix(home) @ qvel[dof : dof + 3]).tolist()
            else:
                here.append(float(qpos[at] - m.qpos0[at]))
                there.append(float(qvel[dof]))
                low, high = m.jnt_range[j]
                if m.jnt_limited[j] and not low <= qpos[at] <= high:
                    beyond.append(m.joint(j).name or body)
        return q, v, beyond

    def rest(self) -> None:
        """Report element types that are skipped entirely."""
        m, reader = self.m, self.reader
        for g in map(int, m.set_in("geom_adhesion")):
            if m.touching[g]:
                text = "adhesion: it does not stick to what it touches"
                reader.left_out("geom", m.geom(g).name, text)
        for g in sorted(reader.planes.intersection(m.set_in("geom_surfacevel").tolist())):
            reader.left_out("geom", m.geom(g).name, "surfacevel: the ground does not move")
        for p in map(int, m.set_in("pair_adhesion")):
            if m.pair_dim[p]:
                reader.left_out("pair", m.pair(p).name, "adhesion of a pair")
        drawn = {int(t) for k in m.textured for t in m.mat_texid[k] if t >= 0}
        if drawn:
            text = f"{len(drawn)} textures: what has one is drawn in its mean colour"
            reader.report.add("approximated", reader.path.name, text)
        for count, what, acts in (
            (m.nflex, "flexible bodies", True),
            (m.nplugin, "plugins", True),
            (m.ntex - len(drawn), "textures", False),
            (m.nskin, "skins", False),
            (m.ncam, "cameras", False),
            (m.nlight, "lights", False),
        ):
            if count:
                reader.report.add("left out", reader.path.name, f"{count} {what}", acts=acts)
        if turning := int((m.jnt_type < 2).sum()):
            text = (
                f"{turning} ball or free joints, whose q and v are other numbers than qpos and "
                "qvel: those of a ball are in its parent's axes, v of a free joint is "
                "[angular; linear] in the world's axes"
            )
            reader.report.add("converted", reader.path.name, text)
        for b in np.flatnonzero(m.body_mocapid >= 0):
            name = reader.names[b]
            text = "a mocap body does not move"
            where = reader.where("body", m.body(int(b)).name)
            reader.report.add("converted", where, text, part=name)


def within_margin(
    reader: Reading, tag: str, name: str, low: float, high: float, margin: float
) -> tuple[float, float]:
    """Return the limits at which MuJoCo stops a joint or tendon, `margin` inside its range.

    The reference of MuJoCo's limits is the distance less the margin, so this is where they rest.
    """
    if not margin or low >= high:
        return low, high
    if low + margin < high - margin:
        text = f"its limits stand {margin:.6g} inside of its range, by its margin"
        reader.report.add("converted", reader.where(tag, name), text)
        return low + margin, high - margin
    text = f"a margin of {margin:.6g} that leaves nothing of its range; the range is kept without"
    reader.left_out(tag, name, text)
    return low, high


def end_name(name: str, k: int) -> str:
    """Return the name of the site that `write_mjcf` writes at an end and that the reader skips."""
    return f"{name} end {k}"


def _relative(a: Array, b: Array) -> Any:
    """Return the rotation of the body at site b relative to a's if the sites coincide."""
    w, x, y, z = unit(b.tolist())
    return multiply(unit(a.tolist()), (w, -x, -y, -z))
