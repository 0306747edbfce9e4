"""Forces in an MJCF file: actuators, tendons, fluid drag and gravity compensation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import choices, needed, shown
from ..forces import LinearActuator, Muscle, Strut
from ..forces.bushing import Bushing
from ..forces.strut import Lines
from ..model import Actuator, Drag, Force, Motor, Servo, SpeedServo, Spring, Tendon, Wrench
from ..rotation import unit
from .conversion import NO_LIMIT, unused
from .mjcf_actuators import ON_JOINT, ON_TENDON, channel, left, pass_on
from .mjcf_compiled import BALL, FREE, MINVAL, Reading
from .mjcf_muscles import is_muscle, muscle_of, why_not
from .mjcf_tendon_paths import ALONG_JOINT, PULLEY, SITE, TendonPaths

Array = np.ndarray
TENDON = 3  # mjtEq
INTEGRATOR, FILTERS = 1, (2, 3)  # mjtDyn: integrator, (filter, filterexact)
GROUPS = 31  # number of actuator groups that MuJoCo can switch off, 0 to 30


class Sums(dict[int, float]):
    """The coefficients of a linear combination of joint coordinates, by joint."""


class Forces(TendonPaths):
    """The forces of a model."""

    def __init__(self, reader: Reading):
        self.reader, self.m, self.report = reader, reader.m, reader.report
        self.actuators = len(self.m.actuator_trnid)
        if passed := pass_on(self.m):
            text = f"that of its joint or tendon, times the square of its gear: {choices(passed)}"
            self.report.add("converted", self.reader.path.name, text)
        self.obey_flags()

    def obey_flags(self) -> None:
        """Remove everything that the global flags in the file disable."""
        m = self.m
        flags = {
            "LIMIT": ("jnt_limited", "tendon_limited"),
            "FRICTIONLOSS": ("dof_frictionloss", "tendon_frictionloss"),
            "SPRING": ("jnt_stiffness", "tendon_stiffness"),
            "DAMPER": ("dof_damping", "tendon_damping"),
            "CLAMPCTRL": ("actuator_ctrllimited",),
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
            sliding, across, spinning, rolling, along = m.opt.o_friction
            m.geom_friction[:] = (sliding, spinning, rolling)
            m.pair_friction[:] = m.opt.o_friction
            m.geom_margin[:] = m.pair_margin[:] = m.opt.o_margin
            text = "the file overrides the friction of all geoms by o_friction"
            self.report.add("converted", self.reader.path.name, text)
            if sliding != across or rolling != along:
                text = "o_friction that depends on the direction: its first number holds for all"
                self.reader.left_out("option", "", text)
        springs, dampers = (int(getattr(bits, f"mjDSBL_{x}", 0)) for x in ("SPRING", "DAMPER"))
        # without both, MuJoCo computes no passive force, so no drag and compensation of gravity
        self.passive = not (m.opt.disableflags & springs and m.opt.disableflags & dampers)
        self.filters = not m.opt.disableflags & int(bits.mjDSBL_FILTERPARENT)
        self.driven = not m.opt.disableflags & int(bits.mjDSBL_ACTUATION)
        if self.actuators and not self.driven:
            text = (
                f"the file switches off: actuation, so its {self.actuators} actuators are left out"
            )
            self.report.add("left out", self.reader.path.name, text)

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
        """Return the length of a tendon at q = 0, the initial pose of the file."""
        return sum(x * float(self.m.qpos0[self.m.jnt_qposadr[j]]) for j, x in sums.items())

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
                for text in left(self.m, a):
                    self.reader.left_out("actuator", name, text)
                yield one
        yield from self._tendons()
        yield from self._drags()
        yield from self._lifts()
        yield from self._mounts()

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
        if not (self.passive and m.ngravcomp):  # ngravcomp counts positive numbers
            return
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
        """Yield the active tendons, both those along joints and those from site to site."""
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
            if m.tendon_springyield[t] or any(
                np.any(getattr(m, f"tendon_{x}poly", np.zeros(t + 1))[t])
                for x in ("stiffness", "damping")
            ):
                self.reader.left_out("tendon", name, "a tendon that is not linear or elastic")
                continue
            if armature := float(m.tendon_armature[t]):
                text = f"the armature {armature:g} of a tendon, an inertia along it"
                self.reader.left_out("tendon", name, text)
                if not (pulls or m.tendon_frictionloss[t] or m.tendon_limited[t]):
                    continue
            sums = self._along_joints(t)
            if sums is None:
                yield from self._over_sites(t, name)
            elif self._slack(t):
                text = "a tendon along joints with a slack range of its spring"
                self.reader.left_out("tendon", name, text)
            else:
                yield self._tendon(t, name, sums)

    def _slack(self, t: int) -> bool:
        """Check whether the spring of a tendon has a range of lengths without force."""
        shortest, longest = self.m.tendon_lengthspring[t]
        return bool(self.m.tendon_stiffness[t]) and shortest != longest

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

    def _over_sites(self, t: int, name: str) -> Iterator[Spring | Strut]:
        """Yield a spring for a tendon over sites and around geoms.

        One with a slack range is a strut, with a spring beside it if the length has limits.
        """
        m, path = self.m, self._path(t)
        if m.tendon_frictionloss[t]:
            path = "a tendon with friction, over sites or around geoms"
        if isinstance(path, str):
            self.reader.left_out("tendon", name, path)
            return
        if not path:
            return
        ends = {k: end for k, end in self._ends(t, name).items() if k == "high" or end > 0}
        if path["via"] and ends:
            text = (
                "limits of a tendon over more than two sites, which act here if they are straight"
            )
            self.reader.left_out("tendon", name, text)
            ends = {}
        stiffness, damping = float(m.tendon_stiffness[t]), float(m.tendon_damping[t])
        if not self._slack(t):
            rest = float(m.tendon_lengthspring[t, 0])
            yield Spring(name=name, stiffness=stiffness, damping=damping, rest=rest, **path, **ends)
            return
        damper = Lines(x=(0.0, 1.0), value=(0.0, damping)) if damping else None
        shortest, longest = m.tendon_lengthspring[t].tolist()
        yield Strut(name=name, spring=slack(stiffness, shortest, longest), damper=damper, **path)
        if ends:
            yield Spring(name=f"limits of {name}", rest=longest, **path, **ends)

    def _actuator(self, a: int, name: str) -> Force | None:
        """Return the force of an actuator, gear x (gain u + b0 + b1 length + b2 rate)."""
        m, kind = self.m, int(self.m.actuator_trntype[a])
        target = int(m.actuator_trnid[a, 0])
        sums = self._moved(a)
        if is_muscle(m, a):
            return self._muscle(a, name)
        if why := self._strange(a):
            self.reader.left_out("actuator", name, why)
            return None
        if sums is None:
            return self._along_path(a, name)
        output, control = channel(self.m, a)
        gear, gain, (b0, b1, b2) = self._law(a)
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

    def _law(self, a: int) -> tuple[float, float, list[float]]:
        """Return gear, gain and bias (3,) of an actuator."""
        m, (output, _) = self.m, channel(self.m, a)
        affine = m.actuator_biastype[a] == 1
        bias = [float(x) if affine else 0.0 for x in m.actuator_biasprm[a, :3]]
        return float(m.actuator_gear[output, 0]), float(m.actuator_gainprm[a, 0]), bias

    def _muscle(self, a: int, name: str) -> Muscle | None:
        """Return the muscle of an actuator along the path of a tendon."""
        m, (output, control) = self.m, channel(self.m, a)
        gear = float(m.actuator_gear[output, 0])
        text: Any = "a muscle that does not act along a tendon over sites"
        if m.actuator_trntype[a] == ON_TENDON and self._moved(a) is None:
            text = why_not(m, a, gear) or self._path(int(m.actuator_trnid[a, 0]))
        if isinstance(text, str):
            self.reader.left_out("actuator", name, text)
        if isinstance(text, str) or not text:
            return None
        fields = {**text, **muscle_of(m, a, gear)}
        weakest, strongest, shared = self._forces_of(a)
        if weakest > -np.inf or strongest < 0.0 or (shared > 1 and strongest < np.inf):
            text = (
                f"a limit of its force, {weakest:g} to {strongest:g}, which a muscle has not here"
            )
            self.reader.left_out("actuator", name, text)
        self._tell_limits(a, name)
        (low, high), (least, most) = self._range("ctrl", control), self._range("act", a)
        if high < 1.0 or least > 0.0 or most < 1.0:
            text = "a muscle whose control or activation is held below 1, or its activation above 0"
            self.reader.left_out("actuator", name, text)
        if low > 0.0:
            fields["weakest"] = low
        return Muscle(name=name, **fields)

    def _along_path(self, a: int, name: str) -> LinearActuator | None:
        """Return the force of an actuator along the path of a tendon."""
        m, t = self.m, int(self.m.actuator_trnid[a, 0])
        path = self._path(t)
        if m.actuator_dyntype[a]:
            path = "an actuator with a filter or an integral, on a tendon over sites"
        if isinstance(path, str):
            self.reader.left_out("actuator", name, path)
        if isinstance(path, str) or not path:
            return None
        self._tell_limits(a, name)
        gear, gain, (b0, b1, b2) = self._law(a)
        fields: dict[str, Any] = {
            "gain": gear * gain, "bias": gear * b0, "kp": -(gear**2) * b1, "kd": -(gear**2) * b2,
        }  # fmt: skip
        low, high = self._range("ctrl", channel(self.m, a)[1])
        fields |= {"input_low": low, "input_high": high, "input": min(max(0.0, low), high)}
        *ends, shared = self._forces_of(a)
        limits = zip(("force_low", "force_high"), sorted(gear * x for x in ends))
        bounds = {key: end for key, end in limits if np.isfinite(end)}
        if bounds and (b1 or b2):
            text = "a limit of a force that depends on the length of a tendon over sites"
            self.reader.left_out("actuator", name, text)
            bounds = {}
        elif shared > 1:
            self._tell_shared(name)
        fields = {key: x + 0.0 for key, x in fields.items() if np.isfinite(x)}
        given: dict[str, Any] = {**path, **fields, **bounds}
        return LinearActuator(name=name, **given)

    def _tell_limits(self, a: int, name: str) -> None:
        """Report the limits of what actuators give in joints that a path moves."""
        limited = [j for j in self._joints_of(a) if self.m.jnt_actfrclimited[j]]
        if limited:
            names = choices(shown(self.m.joint(j).name) for j in limited)
            text = f"the limit of what actuators give in joint {names}, which its path moves"
            self.reader.left_out("actuator", name, text)

    def _joints_of(self, a: int) -> Collection[int]:
        """Return the joints that an actuator moves, also by the path of a tendon."""
        m, t = self.m, int(self.m.actuator_trnid[a, 0])
        if m.actuator_trntype[a] not in (*ON_JOINT, ON_TENDON):
            return ()
        if (sums := self._moved(a)) is not None:
            return sums
        parts = range(first := int(m.tendon_adr[t]), first + int(m.tendon_num[t]))
        above = list[set[int]]()
        for w in parts:
            if m.wrap_type[w] != PULLEY:
                places = m.site_bodyid if m.wrap_type[w] == SITE else m.geom_bodyid
                above.append({*self._joints_above(int(places[m.wrap_objid[w]]))})
        return set.union(*above) - set.intersection(*above)

    def _forces_of(self, a: int) -> tuple[float, float, int]:
        """Return the least and greatest force of an actuator and its tendon, before its gear.

        The third number tells how many actuators share the limit of the tendon.
        """
        m, t = self.m, int(self.m.actuator_trnid[a, 0])
        low, high = self._range("force", a)
        if m.actuator_trntype[a] != ON_TENDON or not m.tendon_actfrclimited[t]:
            return low, high, 0
        least, most = m.tendon_actfrcrange[t].tolist()
        same = (m.actuator_trntype == ON_TENDON) & (m.actuator_trnid[:, 0] == t)
        return max(low, least), min(high, most), int(same.sum())

    def _tell_shared(self, name: str) -> None:
        text = "the limit of the sum of several actuators holds for each of them here"
        where = self.reader.where("actuator", name)
        self.report.add("approximated", where, text, acts=True, part=name)

    @cached_property
    def _actuators_of(self) -> Counter[int]:
        """The number of actuators of each joint, also along tendons."""
        return Counter(j for a in range(self.actuators) for j in self._joints_of(a))

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
        output, control = channel(self.m, a)
        if m.actuator_trntype[a] not in (*ON_JOINT, ON_TENDON):
            return "an actuator that does not act on a joint or tendon (on a site or body)"
        if m.actuator_trntype[a] != ON_TENDON and m.jnt_type[m.actuator_trnid[a, 0]] < 2:
            return "an actuator on a ball or free joint"
        if m.actuator_gear[output, 0] == 0:
            return "an actuator with gear 0"
        (low, high), (least, most) = self._range("ctrl", control), self._range("act", a)
        filtered = m.actuator_dyntype[a] in FILTERS
        if m.actuator_dyntype[a] not in (0, INTEGRATOR, *FILTERS):
            return "an actuator with a state other than a filter or integral (muscle)"
        if filtered and (least > low or most < high):
            return "an actuator with a bounded filter"
        if m.actuator_gaintype[a] != 0 or m.actuator_biastype[a] not in (0, 1):
            return "an actuator whose gain depends on the state"
        return ""

    def _limits(self, a: int, sums: Sums, name: str) -> dict[str, float]:
        """Return the minimum and maximum torque, before the gear."""
        m, (output, _) = self.m, channel(self.m, a)
        gear = float(m.actuator_gear[output, 0])
        low, high, shared = self._forces_of(a)
        for j, x in sums.items():
            if not m.jnt_actfrclimited[j]:
                continue
            count = self._actuators_of[j]
            if len(sums) == 1:
                ends = sorted(float(end) / (gear * x) for end in m.jnt_actfrcrange[j])
                low, high = max(low, ends[0]), min(high, ends[1])
                shared = max(shared, count)
            elif count > 1 or not self._within(j, gear * x, (low, high)):
                text = f"the limit of what actuators give in joint {shown(m.joint(j).name)}"
                text += ", one of several along the actuator's tendon"
                self.reader.left_out("actuator", name, text)
        if shared > 1:
            self._tell_shared(name)
        if np.isinf(low) and np.isinf(high):
            return {}
        if low >= high or high <= 0 or np.isinf(high):
            text = f"a limit of its force, {low:g} to {high:g}, that leaves no force forwards"
            self.reader.left_out("actuator", name, text)
            return {}
        return {"torque_limit": high} if low == -high else {"torque_limit": high, "torque_low": low}

    def _within(self, j: int, factor: float, ends: tuple[float, float]) -> bool:
        """Check whether forces in these bounds, times a factor, stay within a joint's limit."""
        low, high = self.m.jnt_actfrcrange[j]
        return all(low <= factor * end <= high for end in ends)

    def _mounts(self) -> Iterator[Bushing]:
        """Yield the springs of ball and free joints, whose rest is the initial state."""
        m = self.m
        for j in np.flatnonzero((m.jnt_type <= BALL) & (m.jnt_stiffness > 0)).tolist():
            b, k = int(m.jnt_bodyid[j]), float(m.jnt_stiffness[j])
            if m.body_jntnum[b] > 1:
                text = f"stiffness of a ball joint of {shown(self.reader.names[b])}, beside others"
                self.reader.left_out("joint", m.joint(j).name, text)
                continue
            name, along = self.reader.names[b], k if m.jnt_type[j] == FREE else 0.0
            yield Bushing(
                name=f"spring of {m.joint(j).name or name}", body=name,
                other=self.reader.names[int(m.body_parentid[b])],
                point=tuple((-self.reader.pivot[b]).tolist()), stiffness=(along,) * 3 + (k,) * 3,
            )  # fmt: skip

    def _drags(self) -> Iterator[Drag]:
        """Yield the fluid drag on the bodies, modelled with MuJoCo's inertia boxes."""
        m = self.m
        if not (self.passive and (m.opt.density or m.opt.viscosity)):
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


def slack(stiffness: float, shortest: float, longest: float) -> Lines:
    """Return the table of a spring that acts below one length and above another [m]."""
    x, value = (longest, 2.0 * longest), (0.0, stiffness * longest)
    if shortest > 0.0:
        x, value = (shortest, *x), (0.0, *value)
    return Lines(x=(0.0, *x), value=(-stiffness * shortest, *value))


def within_margin(
    reader: Reading, tag: str, name: str, low: float, high: float, margin: float
) -> tuple[float, float]:
    """Return the limits at which MuJoCo stops a joint or tendon, `margin` inside its range.

    In MuJoCo, limits refer to the distance minus the margin, which is therefore zero at rest.
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
