"""MJCF export: the tree, simple loops as site equalities, contacts, motors and servos."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..dynamics import Dynamics, model_of
from ..errors import FileError, ModelError, Problem, choices, explained, shown
from ..fields import GROUND
from ..model import (
    Body,
    Coupling,
    Gear,
    Model,
    Motion,
    Polynomial,
    Relation,
)
from ..model.files import gathered, write_atomic
from ..model.output import OF_CONTACT, OF_JOINT, OF_SUBTREE
from ..model.shape import corners_of
from ..rotation import frame_of, matrix, quaternion_of, unit
from ..shapes import kind_of
from ..shapes.meshes import scales
from ..tolerances import ROUNDING
from .conversion import Report, named, nearest_inertia, tell_beams, why_unphysical
from .mjcf_compiled import GREY, MINVAL
from .mjcf_contacts import FRICTIONLESS
from .mjcf_contacts_out import WORLD, condim, geom_name
from .mjcf_forces_out import ForcesOut
from .mjcf_keys import keyframes
from .mjcf_parts import SENSORS, end_name
from .mjcf_places_out import NOTHING, span
from .urdf_out import Placed, Tag, tell_taper

WORDS = {"rotate": "hinge", "translate": "slide", "ball": "ball", "free": "free"}
INSTEAD = {"screw": "; use a cylindrical joint and a pg.Coupling"}
MASSLESS = "without mass and inertia, also of welded bodies"


@explained
def write_mjcf(model: Model | Dynamics, path: str | Path) -> Report:
    """Write a model as an MJCF file.

    The supported parts are trees, contacts, motors, servos, springs, and constraints of the kinds
    point, weld, revolute, gear and motion. Meshes from other folders are copied to `meshes` next to
    the file.

    Parameters
    ----------
    model : Model or Mechanism
        The model.
    path : str or path
        The file, with the suffix .xml or .mjcf.

    Returns
    -------
    Report
        Elements that are not supported by the format.

    Raises
    ------
    FileError
        If the file cannot be written.
    ModelError
        If the model has a screw joint, or a free joint that is not at the root, which MJCF does not
        support. No file is written in this case.
    """
    whole: Model = model_of("write_mjcf", model).expanded
    path = named(path, ".xml", ".mjcf")
    if not path.parent.is_dir():
        raise FileError(Problem(str(path), "", f"the folder {path.parent} does not exist"))
    inside = [b for b in whole.bodies if b.floats and b.parent != GROUND]
    if inside:
        text = "is free below another body; MJCF has free joints at the ground only"
        raise ModelError([Problem(f"body '{b.name}'", "joint", text) for b in inside])
    if unknown := [(b, m.kind) for b in whole.bodies for m in b.sequence if m.kind not in WORDS]:
        texts = [
            f"is a {kind}, which MJCF does not have{INSTEAD.get(kind, '')}" for _, kind in unknown
        ]
        raise ModelError(
            [Problem(f"body '{b.name}'", "joint", x) for (b, _), x in zip(unknown, texts)]
        )
    writer = _Writer(whole, path)
    tell_beams(writer.report, whole)
    bodies = gathered(whole.bodies, path.parent)
    write_atomic(path, writer.text(bodies))
    return writer.report


class _Writer(ForcesOut):
    def __init__(self, model: Model, path: Path):
        super().__init__(model, path.name)
        self.folder = path.parent
        self.assets: dict[str, Tag] = {}
        self.of_subtrees: list[tuple[Tag, str]] = []  # sensors and their bodies
        self.massless = list[str]()  # bodies that move
        self.equalities = list[Tag]()

    def text(self, bodies: Sequence[Body]) -> str:
        """The file."""
        m = self.model
        root = Tag("mujoco", model=m.name)
        fixed = {"inertiafromgeom": "false", "angle": "radian", "autolimits": "true"}
        root.add(Tag("compiler", **fixed), Tag("option", gravity=m.gravity, **self._fluid()))
        for site in m.sites:
            self._site(site.body, site.name, site.point, unit(site.rotation))
        sensors = [*self._sensors()]
        self._passive()
        for c in m.constraints:
            self._constraint(c)
        for c in m.controls:
            self.out(f"control '{c.name}'", f"a {c.kind}")
        self.children: dict[str, list[Body]] = {}
        for body in bodies:
            self.children.setdefault(body.parent, []).append(body)
        world = Tag("worldbody")
        if self.floor:
            turn = quaternion_of(frame_of(np.array(m.ground_normal)))
            plane = Tag("geom", name="ground", type="plane", size=(0.0, 0.0, 1.0), quat=turn)
            law = self.of_ground or FRICTIONLESS
            world.add(plane.set(friction=law, condim=condim(law)))
            if m.ground.steps:
                self.out("ground", "its steps", acts=True)
        world.add(*self.sites.get(GROUND, ()))
        for body in self.children.get(GROUND, ()):
            world.add(*self._body(body))
        for sensor, body in self.of_subtrees:
            sensor.set(body=self._written(body))
        assets, drives = Tag("asset").add(*self.assets.values()), [*self._actuators()]
        contact = Tag("contact").add(*self._excluded(bodies), *self._paired())
        parts = (assets, world, contact, Tag("equality").add(*self.equalities),
                 Tag("tendon").add(*self.tendons), Tag("actuator").add(*drives),
                 Tag("sensor").add(*sensors),
                 Tag("keyframe").add(*keyframes(self.model, self.children)))  # fmt: skip
        root.add(*(part for part in parts if part.children))
        self.report.add("read", "", f"{len(bodies)} bodies written")
        if refusals := [*self._refusals()]:
            self.report.refused = (
                f"MuJoCo will reject it, because {'; and because '.join(refusals)}"
            )
        return "\n".join([*root.lines(), ""])

    # -- bodies ----------------------------------------------------------------------------------

    def _body(self, body: Body) -> Iterator[Tag]:
        """Yield the element of a body and its subtree. Consecutive joints may become one body."""
        if body.name == WORLD and self.own_world:
            yield from self._geoms(body)  # the world's own solids
            yield from self.sites.get(body.name, ())
            for child in self.children.get(body.name, ()):
                yield from self._body(child)
            return
        chain = [body]
        while (next_ := self._carried(chain[-1])) is not None:
            chain.append(next_)
        last = chain[-1]
        place, turn = np.array(body.link), tuple(unit(body.rotation))
        if body.floats:
            k = self.number[body.name]
            place, turn = self.home[0][k], quaternion_of(self.home[1][k])
        shift = sum((np.array(b.link) for b in chain[1:]), np.zeros(3))
        own = Tag(
            "body", name=self.body_names[last.name], pos=place + matrix(turn) @ shift, quat=turn
        )
        if last.name in self.lifted:
            own.set(gravcomp=self.lifted[last.name])
        for b in chain:
            if b is not body:
                shift = shift - np.array(b.link)
            own.add(*self._joints(b, -shift))
        if last.mass or any(map(any, last.inertia)):
            own.add(Tag("inertial", pos=last.com, mass=last.mass, **self._inertia(last)))
        if last.joint != "weld" and not self._is_heavy(last):
            self.massless.append(last.name)
            text = f"MuJoCo refuses it: it moves {MASSLESS}"
            self.report.add("warning", f"body '{last.name}'", text, part=last.name)
        inertia = np.array(last.inertia)
        if last.any_inertia and (why := why_unphysical(inertia)):
            self.report.repairs[last.name] = nearest_inertia(inertia)
            text = f"MuJoCo refuses its inertia: {why}"
            self.report.add("warning", f"body '{last.name}'", text, part=last.name)
        own.add(*self._geoms(last), *self.sites.get(last.name, ()))
        for child in self.children.get(last.name, ()):
            own.add(*self._body(child))
        yield own

    def _is_heavy(self, body: Body) -> bool:
        """Check whether MuJoCo lets a body move: with the mass and inertia that are written, or
        those of a body welded to it."""
        filled = body.joint != "weld" and not body.any_inertia  # by `_inertia`
        has_mass, moments = body.mass >= MINVAL, np.linalg.eigvalsh(np.array(body.inertia))
        if has_mass and (filled or moments[0] >= MINVAL):
            return True
        children = self.children.get(body.name, ())
        return any(self._is_heavy(child) for child in children if child.joint == "weld")

    def _refusals(self) -> Iterator[str]:
        """Yield the reasons why MuJoCo refuses the file, with their remedies."""
        if repairs := self.report.repairs:
            yield (
                f"of the physically impossible inertia of {choices(map(shown, repairs))}: write "
                "`report.repaired(model)` instead, or give `pgraph convert` the option --repair"
            )
        if names := self.massless:
            moves, them = ("moves", "it") if len(names) == 1 else ("move", "them")
            yield (
                f"{choices(map(shown, names))} {moves} {MASSLESS}: give {them} both, as in "
                f"`model.edit({shown(names[0])}, mass=0.01, inertia=(1e-6, 1e-6, 1e-6))`"
            )

    def _inertia(self, body: Body) -> dict[str, Any]:
        """Return the inertia. MuJoCo rejects moving bodies without one, such as thin rods."""
        inertia = np.array(body.inertia)
        moments, axes = np.linalg.eigh(inertia)
        least = max(ROUNDING * float(np.abs(moments).max()), 10 * MINVAL)
        if moments[0] > least or body.any_inertia:
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
            return {"fullinertia": (xx, yy, zz, xy, xz, yz)}
        turn = quaternion_of(axes if np.linalg.det(axes) > 0 else -axes)
        if body.joint == "weld":
            return {"diaginertia": np.maximum(moments, 0.0), "quat": turn}
        text = f"a moment of inertia of zero is {least:.3g} kg m^2, because MuJoCo needs one"
        self.report.add("approximated", f"body '{body.name}'", text, part=body.name)
        return {"diaginertia": np.maximum(moments, least), "quat": turn}

    def _carried(self, body: Body) -> Body | None:
        """Return the only child of a massless, empty body. MJCF represents both as one body."""
        children = self.children.get(body.name, ())
        empty = not (body.mass or any(map(any, body.inertia)) or body.shapes)
        if (
            not empty
            or len(children) != 1
            or not body.motions
            or body.floats
            or body.name in self.sites
        ):
            return None
        child = children[0]
        same = abs(unit(child.rotation)[0]) == 1.0
        return child if same and child.motions and not child.floats else None

    def _joints(self, body: Body, pivot: np.ndarray) -> Iterator[Tag]:
        for k, motion in enumerate(body.sequence):
            kind = motion.facts
            joint = Tag("joint", name=self.joints[body.name, k], type=WORDS[motion.kind])
            if not kind.travels:
                joint.set(pos=pivot)
            if kind.directed:
                joint.set(axis=motion.axis)
            for name, value in (
                ("damping", body.damping[k]), ("armature", body.armature[k]),
                ("frictionloss", body.friction[k]), ("stiffness", body.stiffness[k]),
            ):  # fmt: skip
                if value:
                    joint.set(**{name: value})
            if body.friction[k] and kind.attitude:
                text = "its friction is about the axes of the body in MuJoCo, not of the parent"
                self.report.add("converted", f"body '{body.name}'", text, part=body.name)
            if body.stiffness[k] and body.rest[k]:
                joint.set(springref=body.rest[k])
            pair = body.limits[k] if body.limits else None
            if pair is not None:
                joint.set(range=span(*pair))
                self._unsaid_of(body, "limit_restitution", k)
            self._unsaid_of(body, "speed_limit", k, acts=False)
            yield joint

    def _unsaid_of(self, body: Body, field: str, k: int, *, acts: bool = True) -> None:
        """Report a number of a motion that MJCF has no word for, unless it is 0."""
        if value := getattr(body, field)[k]:
            self.out(f"body '{body.name}'", f"its {field} {value:g}", acts=acts, part=body.name)

    # -- shapes ----------------------------------------------------------------------------------

    def _geoms(self, body: Body) -> Iterator[Tag]:
        law = self._law(body.name)
        for k, shape in enumerate(body.shapes):
            geom = Tag("geom", pos=shape.position, quat=unit(shape.rotation))
            if (body.name, k) in self.named_geoms:
                geom.set(name=geom_name(body, k))
            found, acts = kind_of(shape).mjcf(shape), shape.role != "visual"
            if shape.file and not (self.folder / shape.file).is_file():
                what = f"a mesh whose file {shape.file} does not exist"
                self.out(f"body '{body.name}'", what, acts=acts)
                continue
            if found is None:
                of = f" of {Path(shape.file).suffix}" if shape.file else ""
                self.out(f"body '{body.name}'", f"a {shape.kind}{of}", acts=acts)
                continue
            if shape.hull == "parts" and acts:
                text = "a mesh touches by its convex hull in MuJoCo, not by its hull 'parts'"
                self.report.add("left out", f"body '{body.name}'", text, acts=True, part=body.name)
            tell_taper(self.report, body.name, shape)
            geom.set(type=found[0])
            geom.set(**({"mesh": self._asset(shape)} if shape.file else {"size": found[1]}))
            if shape.role == "visual":
                geom.set(contype="0", conaffinity="0", group="2")
            elif shape.role == "collision":
                geom.set(group="3")
            if shape.role != "visual":
                geom.set(friction=law, condim=condim(law))
            if shape.colour is not None or shape.opacity < 1.0:
                geom.set(rgba=(*(shape.colour or GREY[:3]), shape.opacity))
            if shape.moves:
                geom.set(surfacevel=(*shape.surface_velocity, *shape.surface_spin))
            yield geom

    def _asset(self, shape: Any) -> str:
        scale = scales(shape)
        key = (
            f"{Path(shape.file).stem} {scale}"
            if scale != (1.0, 1.0, 1.0)
            else Path(shape.file).stem
        )
        name, k = key, 2
        while name in self.assets and self.assets[name].attributes["file"] != shape.file:
            name, k = f"{key} {k}", k + 1
        mesh = Tag("mesh", name=name, file=shape.file, scale=scale)
        self.assets[name] = mesh.set(
            inertia="shell"
        )  # inertia is that of bodies, and flat meshes have none
        return name

    # -- loops -----------------------------------------------------------------------------------

    def _constraint(self, c: Any) -> None:
        name, where = c.name, f"constraint '{c.name}'"
        active = {} if c.active else {"active": "false"}
        match c:
            case Gear() | Relation():
                curve = (c.offset, c.ratio) if isinstance(c, Gear) else c.curve
                curve = curve.coefficients if isinstance(curve, Polynomial) else curve
                if not isinstance(curve, tuple) or len(curve) > 5:
                    text = "a relation that is no polynomial of degree 4 or less"
                    self.out(where, text, acts=c.active)
                    return
                mine = self._joint(c.body, c.coordinate)
                other = self._joint(c.other, c.other_coordinate)
                if not (mine and other):
                    self.out(where, f"a {c.kind} of a ball or free joint", acts=c.active)
                    return
                curve = (*curve, *(0.0,) * (5 - len(curve)))
                tag = Tag("joint", name=name, joint1=mine, joint2=other, polycoef=curve, **active)
                self.equalities.append(tag)
                return
            case Motion(q_of_t=Polynomial(coefficients=held)) if len(held) == 1:
                mine = self._joint(c.body, c.coordinate)
                if not mine:
                    self.out(where, "a motion of a ball or free joint", acts=c.active)
                    return
                curve = (*held, 0.0, 0.0, 0.0, 0.0)
                self.equalities.append(
                    Tag("joint", name=name, joint1=mine, polycoef=curve, **active)
                )
                return
            case Coupling():
                if held := self._along(f"{name} tendon", c, where):
                    curve = (c.value, *(0.0,) * 4)
                    tag = Tag("tendon", name=name, tendon1=held, polycoef=curve, **active)
                    self.equalities.append(tag)
                return
        if c.kind not in ("point", "weld", "revolute"):
            self.out(where, f"a {c.kind} constraint", acts=c.active)
            return
        ends = Placed(self.model, c)
        pairs = [(ends.point, ends.other_point)]
        if c.kind == "revolute" and ends.axis is not None and ends.other_axis is not None:
            size = float(np.abs(self.home[0]).max(initial=0.1))
            a, b = (size * x / np.linalg.norm(x) for x in (ends.axis, ends.other_axis))
            pairs.append((ends.point + a, ends.other_point + b))
            self.report.add("converted", where, "becomes two connected points on the axis")
        turn = quaternion_of(ends.turn) if c.kind == "weld" else NOTHING
        tag = "weld" if c.kind == "weld" else "connect"
        for k, (point, other_point) in enumerate(pairs):
            own = self._free("equality", name if k == 0 else f"{name} {k + 1}")
            one = self._site(c.body, end_name(own, 1), point)
            two = self._site(c.other, end_name(own, 2), other_point, turn)
            self.equalities.append(Tag(tag, name=own, site1=one, site2=two, **active))

    # -- outputs ---------------------------------------------------------------------------------

    def _sensors(self) -> Iterator[Tag]:
        """Yield outputs as sensors. Sensors on bodies are attached to additional sites."""
        words = {kind: word for word, kind in SENSORS.items()}
        found = self.model.sites
        sites = {s.name for s in found}
        for o in self.model.outputs:
            tag = Tag(words[o.kind], name=o.name)
            if o.imperfect is not None:
                self.out(f"output '{o.name}'", "samples with noise and delay", acts=False)
            if o.kind in OF_JOINT:
                if not (joint := self._joint(o.at, o.coordinate)):
                    text = f"a {o.kind} of a ball or free joint"
                    self.out(f"output '{o.name}'", text, acts=False)
                    continue
                tag.set(joint=joint)
            elif o.kind in OF_SUBTREE:
                body = next((s.body for s in found if s.name == o.at), o.at)
                self.of_subtrees.append((tag, body))
            elif o.kind in OF_CONTACT:
                site = next((s for s in found if s.name == o.at), None)
                body, away = (o.at, 0.0) if site is None else (site.body, math.hypot(*site.point))
                name = o.at if o.at in sites else self._site(body, end_name(o.name, 1), (0.0,) * 3)
                shapes = self.model.body(body).shapes
                ends = [np.linalg.norm(corners_of(shape), axis=1).max() for shape in shapes]
                sphere = next(x for x in self.sites[body] if x.attributes["name"] == name)
                sphere.set(size=2.0 * (max(ends, default=1.0) + away), group="5")
                tag.set(site=name)
            else:
                name = o.at if o.at in sites else self._site(o.at, end_name(o.name, 1), (0.0,) * 3)
                in_world = o.kind in ("position", "rotation", "velocity", "angular_velocity")
                tag.set(**({"objtype": "site", "objname": name} if in_world else {"site": name}))
            yield tag

    def _written(self, name: str) -> str:
        """Return the name of the body in the file that carries what a body carries."""
        if name == GROUND:
            return WORLD
        carried = self._carried(self.model.body(name))
        return self.body_names[name] if carried is None else self._written(carried.name)
