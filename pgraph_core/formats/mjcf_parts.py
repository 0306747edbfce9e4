"""Equality constraints, sites, sensors and keyframes in an MJCF file."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import choices, needed, shown
from ..fields import GROUND, name_problem
from ..model import (
    Constraint,
    Coupling,
    Gear,
    Imperfect,
    Motion,
    Output,
    Polynomial,
    Relation,
    Scenario,
    Site,
)
from ..model.output import OF_CONTACT, OF_SUBTREE, Kind
from ..rotation import matrix, multiply, unit
from ..tolerances import SOLVED
from .conversion import suspect_rings, unused
from .mjcf_forces import TENDON, Forces, Sums

Array = np.ndarray
CONNECT, WELD, JOINT = 0, 1, 2  # mjtEq
INERTIAL, BODIES, GEOMS, SITES, CAMERAS = 1, 2, 5, 6, 7  # mjtObj: body, xbody, geom, site, camera
REAL = 0  # mjtDataType: values of both signs
SENSORS: dict[str, Kind] = {  # kind of output for each sensor of MuJoCo
    "jointpos": "joint_position", "jointvel": "joint_velocity", "framepos": "position",
    "framequat": "rotation", "framelinvel": "velocity", "frameangvel": "angular_velocity",
    "velocimeter": "velocimeter", "gyro": "gyro", "accelerometer": "accelerometer",
    "force": "force", "torque": "torque", "subtreecom": "subtree_position",
    "subtreelinvel": "subtree_velocity", "subtreeangmom": "subtree_momentum",
    "touch": "touch",
}  # fmt: skip


class Parts(Forces):
    """The parts of a model other than the bodies."""

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
        if leader < 0 or not np.any(data[1:5]):
            held = {"kind": "polynomial", "coefficients": [float(data[0])]}
            return Motion(name=name, body=body, coordinate=coordinate, q_of_t=held, active=active)
        other, k = self.reader.place_of_joint[leader]
        if np.any(data[2:5]):
            powers = Polynomial(coefficients=np.trim_zeros(data[:5], "b"))
            return Relation(
                name=name, body=body, coordinate=coordinate, other=other, other_coordinate=k,
                curve=powers, active=active,
            )  # fmt: skip
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
        if kind == WELD and data[10] == 0.0:  # a weld whose torques are scaled to nothing
            kind = CONNECT
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
            sampled = k in m.set_in("sensor_interval") and SENSORS.get(word) != "rotation"
            why = "delayed" if k in m.set_in("sensor_delay") and not sampled else ""
            why = why or "seen from another frame" * bool(m.sensor_refid[k] >= 0)
            if word not in SENSORS or why:
                others.setdefault((word, why), []).append(shown(name))
                continue
            fields = self._sensed(k, word, name, sites)
            if sampled:
                fields["imperfect"] = self._imperfect(k)
            elif lost := self._lost(k):
                text = f"its {choices(lost)}: samples need an interval, and no rotation has them"
                self.reader.left_out("sensor", name, text, acts=False)
            found[name] = Output(name=name, kind=SENSORS[word], **fields)
            if SENSORS[word] in OF_CONTACT:
                text = "it reads the size of the sum of all contact forces on its body, with "
                text += "friction, whereas MuJoCo adds the normal forces within the site"
                where = self.reader.where("sensor", name)
                self.report.add("approximated", where, text, acts=True, part=name)
        for (word, why), names in others.items():
            text = f"of kind {word}{', ' * bool(why)}{why}: {choices(names, 6)}"
            self.reader.left_out("sensor", "", text, acts=False)
        return list(found.values())

    def _imperfect(self, k: int) -> Imperfect:
        """Return the imperfections of a sensor with an interval: its delay, noise and cutoff."""
        m, limit = self.m, float(self.m.sensor_cutoff[k])
        sample, high = float(m.sensor_interval[k, 0]), limit if limit > 0.0 else None
        both = high is not None and m.sensor_datatype[k] == REAL
        return Imperfect(
            sample=sample, latency=float(m.sensor_delay[k]), low=-limit if both else None,
            high=high, density=float(m.sensor_noise[k]) * sample**0.5,
        )  # fmt: skip

    def _lost(self, k: int) -> list[str]:
        """Return which properties a sensor has that need samples."""
        each = ("cutoff", "noise", "interval")
        return [name for name in each if k in self.m.set_in(f"sensor_{name}")]

    def _sensed(self, k: int, word: str, name: str, sites: list[Site]) -> dict[str, Any]:
        """Return the object of a sensor: a coordinate, a body, or a site, possibly new."""
        m, what = self.m, int(self.m.sensor_objid[k])
        if word in ("jointpos", "jointvel"):
            if m.qpos0[m.jnt_qposadr[what]] and word == "jointpos":
                text = "it counts from the file's initial pose here"
                self.report.add("converted", self.reader.where("sensor", m.sensor(k).name), text)
            body, coordinate = self.reader.place_of_joint[what]
            return {"at": body, "coordinate": coordinate}
        if SENSORS[word] in OF_SUBTREE:
            return {"at": self.reader.names[what]}
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
        m, found = self.m, list[Scenario]()
        moved = sorted(np.flatnonzero(m.body_mocapid >= 0), key=lambda b: m.body_mocapid[b])
        home, left_out = m.body_pos[moved].ravel(), self.reader.left_out
        for k in range(m.nkey):
            name = unused(m.key(k).name or f"key {k + 1}", {s.name for s in found})
            q, v, beyond = self._state(m.key_qpos[k], m.key_qvel[k])
            if beyond:
                text = f"it starts beyond the limits of {', '.join(beyond)}, which hold it there"
                self.report.add("warning", self.reader.where("key", name), text)
            if np.any(m.key_ctrl[k]):
                text = "its controls; a run takes them as inputs={name: value}"
                left_out("key", name, text, acts=False)
            if np.any(m.key_act[k]):
                text = "its activations; `start` of a motor or servo is its initial value"
                left_out("key", name, text, acts=False)
            if np.any(np.abs(m.key_mpos[k] - home) > SOLVED):
                left_out("key", name, "positions of mocap bodies")
            found.append(Scenario(name=name, q=q, v=v))
        return found

    def _state(self, qpos: Array, qvel: Array) -> tuple[Any, Any, list[str]]:
        """Return q and v by body for a MuJoCo state, and the joints whose limits it exceeds."""
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
        for g in sorted(m.set_in("geom_adhesion")):
            if m.touching[g]:
                text = "adhesion, which is not supported"
                reader.left_out("geom", m.geom(g).name, text)
        for g in sorted(reader.planes & m.belts):
            reader.left_out("geom", m.geom(g).name, "surfacevel: the ground does not move")
        for p in sorted(m.set_in("pair_adhesion")):
            if m.pair_dim[p]:
                reader.left_out("pair", m.pair(p).name, "adhesion of a pair")
        drawn = {int(t) for k in m.textured for t in m.mat_texid[k] if t >= 0}
        if drawn:
            text = f"{len(drawn)} textures: they are replaced by their mean colour"
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
            text = "a mocap body does not move; to move it, give it a joint and a pg.Motion"
            where = reader.where("body", m.body(int(b)).name)
            reader.report.add("converted", where, text, part=name)


def end_name(name: str, k: int) -> str:
    """Return the name of the site that `write_mjcf` creates at an end point. The reader ignores
    this site."""
    return f"{name} end {k}"


def _relative(a: Array, b: Array) -> Any:
    """Return the rotation of the body at site b relative to a's if the sites coincide."""
    w, x, y, z = unit(b.tolist())
    return multiply(unit(a.tolist()), (w, -x, -y, -z))
