"""MJCF import: MuJoCo reads and compiles the file, and the result is converted to a model.

MuJoCo itself therefore handles defaults, includes, orientations, degrees and inertias from geoms.
The origin of a body is placed at the anchor of its hinges. If a body has hinges at several
positions, massless bodies are inserted. Coordinates count from the file's own initial pose.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError, ModelError, Problem, explained, needed, shown
from ..fields import GROUND, name_problem
from ..joints import parallel
from ..mesh_files import FORMATS
from ..model import Body, Contact, Force, Model
from ..model.files import kept_mesh
from ..rotation import matrix, multiply, unit
from ..shapes import KINDS, Geom
from .conversion import (
    Folders,
    MeshSize,
    Report,
    reach_of,
    suspect_meshes,
    suspect_units,
    unphysical,
    unused,
)
from .mjcf_compiled import BALL, FREE, HINGE, SLIDE, Compiled, Group
from .mjcf_contacts import Contacts
from .mjcf_files import Files
from .mjcf_forces import within_margin
from .mjcf_parts import Parts

Array = np.ndarray
PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
WORLD = "world"
INITIAL = "initial state"  # a keyframe of this name is that


@explained
def read_mjcf(path: str | Path, roots: Iterable[str | Path] = ()) -> tuple[Model, Report]:
    """Read an MJCF file using MuJoCo.

    Parameters
    ----------
    path : str or path
        The file.
    roots : iterable of paths
        Additional folders for included files and meshes. By default they must be in the nearest
        parent folder with a package.xml, or in the folder of the file.

    Returns
    -------
    model : Model
        The model.
    report : Report
        Omissions and warnings, which can be printed.

    Raises
    ------
    FileError, ModelError
        If the file cannot be read.
    MissingPackage
        If MuJoCo is not installed.
    """
    path = Path(path)
    files = Files(path, Folders(path, roots))
    mujoco = needed("mujoco", "mjcf")
    try:
        spec = files.spec(mujoco)
        compiled = spec.compile()
    except Exception as error:  # whatever MuJoCo raises of a file that it refuses
        text = " ".join(str(error).split())
        absent = [one for one in files.absent if "opening file" in text]
        if unknown := re.search(r"unrecognized (\w+)(: '[^']*')? Element ('[^']*')", text):
            what, name, element = unknown.groups()
            what += f"{(name or '').lstrip(':')} of element" if name else ""
            text += f"; MuJoCo {mujoco.__version__} does not know it: remove the {what} {element}"
        raise FileError(absent or Problem(path.name, "", f"MuJoCo refuses it: {text}")) from None
    _usable(compiled, path)
    moved = {m.id for m in spec.meshes if np.any(m.refpos) or np.any(m.refquat[1:])}
    return _Reader(Compiled(compiled), path, files, moved).result()


def _usable(compiled: Any, path: Path) -> None:
    """Reject numbers that overflowed or vanished in MuJoCo's compiler. Raises FileError."""
    m = compiled
    of_bodies = (m.body_mass[:, None], m.body_pos, m.body_quat, m.body_ipos, m.body_iquat)
    of_geoms = (m.geom_pos, m.geom_quat, m.geom_size)
    for kind, numbers, turns, name in (
        ("body", (*of_bodies, m.body_inertia), (m.body_quat, m.body_iquat), m.body),
        ("geom", of_geoms, (m.geom_quat,), m.geom),
    ):
        good = np.isfinite(np.concatenate(numbers, axis=1)).all(axis=1)
        for turn in turns:
            good &= np.linalg.norm(turn, axis=1) > 0.5
        for k in np.flatnonzero(~good)[:1]:
            text = "its mass, place, rotation or size is too large or too small for MuJoCo"
            where = f"{kind} {shown(name(k).name)}"
            raise FileError(Problem(f"{path.name}, {where}", "", text))


class _Reader:
    def __init__(self, m: Compiled, path: Path, files: Files, moved: set[int]):
        self.m, self.files, self.path = m, files, path
        self.moved = moved  # meshes that refpos or refquat move in their axes
        self.report = Report(path.name)
        self.sizes: list[MeshSize] = []
        self.names = self._body_names()
        self.taken = {*self.names}
        self.pivot = np.zeros((m.nbody, 3))
        self.groups = [self._grouped(b) for b in range(m.nbody)]
        self.places = (
            m.geom_pos - self.pivot[m.geom_bodyid]
        ).tolist()  # geom positions in our bodies
        self.place_of_joint: dict[int, tuple[str, int]] = {}
        self.freedoms: dict[str, int] = {}
        for group in (group for groups in self.groups for group in groups):
            count = 0
            for j in group.joints:
                self.place_of_joint[j] = group.name, count
                count += (6, 3, 1, 1)[m.jnt_type[j]]
            self.freedoms[group.name] = count

    def where(self, tag: str, name: str) -> str:
        """Return the location of an element, such as 'robot.xml, line 12, joint 'knee''."""
        line = self.files.lines.get((tag, name), self.path.name)
        return f"{line}, {tag} {shown(name)}" if name else f"{line}, {tag}"

    def left_out(self, tag: str, name: str, text: str, *, acts: bool = True) -> None:
        """Report an element that has no equivalent in a model."""
        self.report.add("left out", self.where(tag, name), text, acts=acts)

    def result(self) -> tuple[Model, Report]:
        """Return the model and the report."""
        m, mujoco = self.m, needed("mujoco", "mjcf")
        for where, key in self.files.newer:
            text = f"attribute '{key}', which is newer than this reader"
            self.report.add("left out", where, text, acts=True)
        self.gravity = np.array(m.opt.gravity)
        if m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
            self.gravity[:] = 0.0
        parts = Parts(self)
        contacts = Contacts(self, parts.filters)
        self.planes = {*contacts.floors, *contacts.walls}
        bodies = [fields for b in range(1, m.nbody) for fields in self._bodies(b)]
        bodies += contacts.world()
        sites = parts.sites([body["name"] for body in bodies])
        outputs = parts.outputs(sites)
        fields: dict[str, Any] = {
            "name": self._name_of_model(),
            "up": "z",
            "gravity": tuple(self.gravity.tolist()),
            "bodies": bodies,
            "constraints": parts.constraints(),
            "contacts": list[Contact](contacts.contacts(bodies)),
            "forces": list[Force](parts.forces()),
            "scenarios": parts.keyframes(),
            "sites": sites,
            "outputs": outputs,
        }
        self._start(fields)
        parts.rest()
        if beyond := int(((m.colours < 0.0) | (m.colours > 1.0)).any(axis=1).sum()):
            text = f"{beyond} geoms have colours beyond 0 to 1, which are limited to that"
            self.report.add("approximated", self.path.name, text)
        try:
            fields["bodies"] = [Body(**body) for body in bodies]  # avoids the search for formulas
            model = Model(**fields)
        except ModelError as error:
            found = [
                Problem(f"{self.path.name}: {p.where}", p.field, p.text) for p in error.problems
            ]
            raise ModelError(found) from None
        places = {self.names[b]: tuple(m.home.xpos[b].tolist()) for b in range(1, m.nbody)}
        suspect_units(self.report, model, reach_of(places))
        suspect_meshes(self.report, model, reach_of(places), self.sizes)
        count = len(m.actuator_trnid)
        text = f"{m.nbody - 1} bodies, {m.njnt} joints, {m.ngeom} geoms, {count} actuators"
        self.report.add("read", self.path.name, text)
        return self.report.attached_to(model), self.report

    def _start(self, fields: dict[str, Any]) -> None:
        """Use the keyframe called "initial state" as the model's initial state."""
        start = next((s for s in fields["scenarios"] if s.name == INITIAL), None)
        if start is None:
            return
        fields["scenarios"].remove(start)
        for body in fields["bodies"]:
            for key, values in (("q", start.q), ("v", start.v)):
                if body["name"] in values:
                    body[key] = values[body["name"]]

    def _name_of_model(self) -> str:
        name = self.m.names[: self.m.names.index(b"\0")].decode(errors="replace")
        return name if name.isprintable() and name.strip() == name and name else self.path.stem

    def _body_names(self) -> list[str]:
        found = {GROUND: 0, "*": 0, WORLD: 0}
        for b in range(1, self.m.nbody):
            name = self.m.body(b).name
            if name_problem(name) or name in found:
                name = f"{name.strip()} {b}" if name.strip().isprintable() and name else f"body {b}"
            found[unused(name, found)] = b
        return [GROUND, *(name for name, b in found.items() if b)]

    # -- bodies ----------------------------------------------------------------------------------

    def _grouped(self, b: int) -> list[Group]:
        """Group a body's joints by anchor position."""
        m = self.m
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        anchored: list[tuple[int, tuple[float, ...]]] = []
        anchor = next((tuple(m.jnt_pos[j]) for j in joints if self._anchored(j)), (0.0,) * 3)
        for j in joints:
            anchor = tuple(m.jnt_pos[j]) if self._anchored(j) else anchor
            anchored.append((j, anchor))
        runs: list[tuple[tuple[float, ...], list[int]]] = []
        for j, pivot in anchored:
            if not runs or pivot != runs[-1][0] or self._repeats(j, runs[-1][1][-1]):
                runs.append((pivot, []))
            runs[-1][1].append(j)
        runs = runs or [((0.0,) * 3, [])]
        name = self.names[b]
        if len(runs) > 1:
            text = f"its joints, at {len(runs)} places or along one axis, become massless bodies"
            self.report.add(
                "converted", self.where("body", m.body(b).name), f"{text} in between", part=name
            )
        self.pivot[b] = runs[-1][0]
        return [
            Group(
                name if k == len(runs) - 1 else self._between(name, k + 1),
                tuple(js), np.array(pivot), k == len(runs) - 1,
            )
            for k, (pivot, js) in enumerate(runs)
        ]  # fmt: skip

    def _between(self, name: str, k: int) -> str:
        """Return an unused name for a massless body inserted before body `name`."""
        found = unused(f"{name}/{k}", self.taken)
        self.taken.add(found)
        return found

    def _repeats(self, j: int, before: int) -> bool:
        """Check whether a joint moves along the axis of the preceding one, as for backlash."""
        m = self.m
        if m.jnt_type[j] != m.jnt_type[before] or m.jnt_type[j] not in (SLIDE, HINGE):
            return False
        return parallel(tuple(m.jnt_axis[j].tolist()), tuple(m.jnt_axis[before].tolist()))

    def _anchored(self, j: int) -> bool:
        return self.m.jnt_type[j] in (BALL, HINGE)

    def _bodies(self, b: int) -> Iterator[dict[str, Any]]:
        m, parent = self.m, int(self.m.body_parentid[b])
        before, base = self.names[parent], -self.pivot[parent]
        turn = tuple(float(x) for x in unit(m.body_quat[b].tolist()))
        for group in self.groups[b]:
            first = group is self.groups[b][0]
            free = [int(m.jnt_type[j]) for j in group.joints] == [FREE]
            link = (
                m.body_pos[b] + matrix(turn) @ group.pivot + base if first else group.pivot - base
            )
            fields: dict[str, Any] = {
                "name": group.name,
                "parent": before,
                "link": (0.0, 0.0, 0.0) if free else tuple(link.tolist()),
                "rotation": (1.0, 0.0, 0.0, 0.0) if free or not first else turn,
                **self._joint(group, free),
                **(self._mass(b) if group.last else NO_MASS),
            }
            yield fields
            before, base = group.name, group.pivot

    def _joint(self, group: Group, free: bool) -> dict[str, Any]:
        m = self.m
        if not group.joints:
            return {"joint": "weld"}
        if free:
            j = group.joints[0]
            at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
            fields: dict[str, Any] = {"joint": "free", "q": tuple(m.qpos0[at : at + 7].tolist())}
            values = m.dof_damping, m.dof_frictionloss, m.dof_armature
            own = {x: (float(y[dof]),) for x, y in zip(("damping", "friction", "armature"), values)}
            self._box(j, dof)
            return fields | own
        kinds = {BALL: "ball", SLIDE: "translate", HINGE: "rotate"}
        motions = [(kinds[int(m.jnt_type[j])], tuple(m.jnt_axis[j].tolist())) for j in group.joints]
        numbers: dict[str, list[float]] = {
            key: [] for key in ("stiffness", "damping", "rest", "friction", "armature")
        }
        limits: list[tuple[float, float] | None] = []
        q: list[float] = []
        for j in group.joints:
            at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
            single = m.jnt_type[j] != BALL
            start = float(m.qpos0[at]) if single else 0.0
            if start:
                text = f"its ref of {start:.6g} is 0 here: MuJoCo's qpos is q + {start:.6g}"
                self.report.add("converted", self.where("joint", m.joint(j).name), text)
            numbers["damping"].append(float(m.dof_damping[dof]))
            numbers["stiffness"].append(float(m.jnt_stiffness[j]) if single else 0.0)
            rest = float(m.qpos_spring[at]) - start if single and m.jnt_stiffness[j] else 0.0
            numbers["rest"].append(rest)
            numbers["friction"].append(float(m.dof_frictionloss[dof]))
            numbers["armature"].append(float(m.dof_armature[dof]))
            if not single:
                self._box(j, dof)
                if m.jnt_limited[j]:
                    self.left_out("joint", m.joint(j).name, "the limit of a ball joint")
            limits.append(self._limit(j, start) if single else None)
            low, high = limits[-1] or (-math.inf, math.inf)
            begin = min(max(0.0, low), high)
            if begin:
                text = f"it starts at {begin:.6g}, at its limit: the file's start lies beyond"
                self.report.add("warning", self.where("joint", m.joint(j).name), text)
            q += [begin] if single else [1.0, 0.0, 0.0, 0.0]
            self._polynomials(j, dof)
        fields = {"joint": "compound", "motions": motions, "q": q, **numbers}
        kinds_of = [kind for kind, _ in motions]
        short = {"rotate": "revolute", "translate": "prismatic", "ball": "spherical"}
        if len(kinds_of) == 1:
            fields["joint"] = short[kinds_of[0]]
        return fields | ({"limits": limits} if any(limits) else {})

    def _limit(self, j: int, start: float) -> tuple[float, float] | None:
        m = self.m
        if not m.jnt_limited[j]:
            return None
        low, high = (float(x) - start for x in m.jnt_range[j])
        low, high = within_margin(self, "joint", m.joint(j).name, low, high, float(m.jnt_margin[j]))
        return (low, high) if low < high else None

    def _box(self, j: int, dof: int) -> None:
        """Report the axes along which friction of a ball or free joint acts."""
        if self.m.dof_frictionloss[dof]:
            text = (
                "its friction acts about the axes of the parent, in MuJoCo about those of the body"
            )
            self.report.add("converted", self.where("joint", self.m.joint(j).name), text)

    def _polynomials(self, j: int, dof: int) -> None:
        m = self.m
        for table, k, text in (
            ("jnt_stiffnesspoly", j, "stiffness that is not linear"),
            ("dof_dampingpoly", dof, "damping that is not linear"),
            ("jnt_springyield", j, "a spring that yields"),
        ):
            if k in m.set_in(table):
                self.left_out("joint", m.joint(j).name, text)
        if m.jnt_actgravcomp[j] and m.jnt_actfrclimited[j] and np.any(m.body_gravcomp):
            text = "a limit of its actuators that also applies to gravity compensation"
            self.left_out("joint", m.joint(j).name, text)

    def _mass(self, b: int) -> dict[str, Any]:
        m = self.m
        inertia, name = m.inertias[b], self.names[b]
        where = self.where("body", m.body(b).name)
        mass = float(m.body_mass[b])
        return {
            "mass": mass,
            "com": tuple((m.body_ipos[b] - self.pivot[b]).tolist()) if mass else (0.0, 0.0, 0.0),
            "inertia": tuple(tuple(row) for row in inertia.tolist()),
            "shapes": [*self.shapes(b)],
            **unphysical(self.report, where, name, inertia),
        }

    # -- shapes ----------------------------------------------------------------------------------

    def shapes(self, b: int) -> Iterator[dict[str, Any]]:
        """Convert the geoms of a body to shapes."""
        m = self.m
        for g in range(m.body_geomadr[b], m.body_geomadr[b] + m.body_geomnum[b]):
            if g not in self.planes and (found := self.solid(g)):
                yield found

    def solid(self, g: int) -> dict[str, Any] | None:
        m = self.m
        geom, acts = m.geoms[g], m.touching[g]
        (x, y, z), kind, turn, rgba = geom.size, geom.kind, unit(geom.quat), geom.rgba
        place = self.places[g]
        role = "visual" if not acts else "collision" if geom.group > 2 else "both"
        shape: dict[str, Any] = {"role": role}
        if rgba is not None:
            shape["colour"], shape["opacity"] = rgba[:3], rgba[3]
        match kind:
            case _ if kind in SOLIDS:
                shape |= {"kind": SOLIDS[kind].name, **SOLIDS[kind].of_mjcf(x, y, z)}
            case 1:  # a heightfield, whose heights are elsewhere
                shape |= self._field(int(m.geom_dataid[g]))
            case 7:  # a mesh
                found = self._mesh(g, acts)
                if found is None:
                    return None
                mesh, shift, own = found
                turn = unit(multiply(turn, own))
                place = (np.array(place) - matrix(turn) @ shift).tolist()
                shape |= mesh
            case _:
                text = "a plane on a body that moves" if kind == PLANE else f"a geom of type {kind}"
                self.left_out("geom", m.geom(g).name, text, acts=acts)
                return None
        if g in m.belts:
            about = np.array(place) - self.places[g]
            axes, old = matrix(turn), matrix(unit(geom.quat))
            spin = old @ m.geom_surfacevel[g, 3:]
            shape["surface_velocity"] = tuple(
                axes.T @ (old @ m.geom_surfacevel[g, :3] + np.cross(spin, about))
            )
            shape["surface_spin"] = tuple(axes.T @ spin)
        shape["position"] = tuple(place)
        if turn != NO_TURN:
            shape["rotation"] = turn
        return shape

    def _field(self, k: int) -> dict[str, Any]:
        """Convert a heightfield. The rows are along y in the file and along x in Pgraph."""
        m = self.m
        x, y, top, below = (float(s) for s in m.hfield_size[k])
        first, shape = int(m.hfield_adr[k]), (int(m.hfield_nrow[k]), int(m.hfield_ncol[k]))
        heights = top * m.hfield_data[first : first + shape[0] * shape[1]].reshape(shape).T
        size = (2 * x, 2 * y, below + float(heights.min()))
        return {"kind": "heightfield", "size": size, "heights": heights.tolist()}

    def _mesh(self, g: int, acts: bool) -> tuple[dict[str, Any], Array, tuple[float, ...]] | None:
        """Return (shape, shift, turn): compiled vertices are turnᵀ (those in the file - shift)."""
        m = self.m
        k = int(m.geom_dataid[g])
        name = m.mesh(k).name
        at = int(m.mesh_pathadr[k])
        if at < 0:
            return self._kept(k, name, "the file itself", acts)
        file = Path(os.fsdecode(m.paths[at : m.paths.index(b"\0", at)])).resolve()
        if why := self.files.folders.outside(file):
            self.left_out("mesh", name, why, acts=acts)
            return None
        if file.suffix.lower().lstrip(".") not in FORMATS or k in self.moved:
            return self._kept(k, name, file.name, acts)
        sizes = tuple(float(x) for x in m.mesh_scale[k])
        scale = sizes[0] if len(set(sizes)) == 1 and sizes[0] > 0 else sizes
        body = self.names[int(m.geom_bodyid[g])]
        size = 2 * float(m.geom_aabb[g, 3:].max())
        self.sizes.append(MeshSize(self.where("mesh", name), body, file.name, size))
        w, i, j, l_ = unit(m.mesh_quat[k].tolist())
        shape = self._of_file(file, acts) | {"scale": scale}
        return shape, m.mesh_pos[k].copy(), (w, -i, -j, -l_)

    def _of_file(self, file: Path, acts: bool) -> dict[str, Any]:
        """Return the fields of a mesh shape."""
        hull = {"hull": "convex"} if acts else {}
        return {"kind": "mesh", "file": str(file), **hull}

    def _kept(
        self, k: int, name: str, source: str, acts: bool
    ) -> tuple[dict[str, Any], Array, tuple[float, ...]] | None:
        """Save a mesh as compiled by MuJoCo to an OBJ file if its `source` cannot be used."""
        m = self.m
        first, face = int(m.mesh_vertadr[k]), int(m.mesh_faceadr[k])
        vertices = m.mesh_vert[first : first + int(m.mesh_vertnum[k])]
        faces = m.mesh_face[face : face + int(m.mesh_facenum[k])]
        text = f"its vertices are written in {source}"
        try:
            file = kept_mesh(name, vertices, faces)
        except FileError as error:
            self.left_out("mesh", name, f"{text}: {error}", acts=acts)
            return None
        self.report.add("converted", self.where("mesh", name), f"{text}; they are kept in {file}")
        return self._of_file(file, acts), np.zeros(3), NO_TURN


# by MuJoCo's number
SOLIDS = {kind.geom: kind for kind in KINDS.values() if isinstance(kind, Geom)}
NO_TURN = (1.0, 0.0, 0.0, 0.0)
NO_MASS = {"mass": 0.0, "inertia": ((0.0,) * 3,) * 3}
