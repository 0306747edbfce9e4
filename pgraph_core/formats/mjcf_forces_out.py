"""Forces in an MJCF file that is written: drives, tendons, fluid drag and lifted weights."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..forces import (
    BetweenPoints,
    Driven,
    LinearActuator,
    Muscle,
    OnJoint,
    Strut,
    Via,
    legs_of,
    path_of,
)
from ..forces.strut import bends
from ..model import Body, Drag, Model, Spring, Tendon, Wrench
from ..rotation import frame_of, matrix, quaternion_of, unit, unit_vector
from ..tolerances import SOLVED
from .mjcf_muscles import numbers_of
from .mjcf_parts import end_name
from .mjcf_places_out import Places, span
from .urdf_out import Tag


class ForcesOut(Places):
    """The forces of a model."""

    def __init__(self, model: Model, name: str):
        super().__init__(model, name)
        self.lifting, self.lifted = set[str](), dict[str, float]()
        self.paths = dict[str, str]()  # the tendons of actuators along paths
        for wrench, body, part in self._lifted():
            self.lifting.add(wrench)
            self.lifted[body] = self.lifted.get(body, 0.0) + part

    def _passive(self) -> None:
        """Write springs, tendons and the paths of actuators."""
        for f in self.model.forces:
            if isinstance(f, BetweenPoints) and f._rides:
                text = "a path with points that move in their bodies, or count in a range only"
                self.out(f"force '{f.name}'", text)
            elif any(len(past) > 1 for past in self._obstacles(f)):
                text = "a path over obstacles without a point between them"
                self.out(f"force '{f.name}'", text)
            elif any(via.radii is not None for past in self._obstacles(f) for via in past):
                self.out(f"force '{f.name}'", "a path over an ellipsoid")
            elif isinstance(f, Spring) and not f._varies:
                limits = {"range": span(f.low or 0.0, f.high)} if f.low or f.high else {}
                numbers = {"stiffness": f.stiffness, "damping": f.damping}
                self._spatial(f, **numbers, springlength=self.rests[f.name], **limits)
            elif isinstance(f, Strut) and (numbers := of_strut(f)):
                self._spatial(f, **numbers)
            elif isinstance(f, LinearActuator) or (isinstance(f, Muscle) and f.model == "mujoco"):
                self.paths[f.name] = self._spatial(f)
            elif isinstance(f, Tendon):
                self._tendon(f)

    def _obstacles(self, f: Any) -> Iterator[tuple[Via, ...]]:
        """Yield the obstacles of each leg of a path."""
        legs = legs_of(f, self.model.body(f.body)) if isinstance(f, BetweenPoints) else ()
        return (past for _, past, _ in legs)

    def _spatial(self, f: BetweenPoints, **given: Any) -> str:
        """Write the tendon of a force along a path, and return its name."""
        body = self.model.body(f.body)
        start, *_, end = path_of(f, body)
        places = [(None, start), *((via, (via.body, via.point)) for via in f.via), (None, end)]
        elements = [
            self._element(end_name(f.name, k), via, *place)
            for k, (via, place) in enumerate(places, start=1)
        ]
        tendon = Tag("spatial", name=self._free("tendon", f.name), **given)
        self.tendons.append(tendon.add(*elements))
        return tendon.attributes["name"]

    def _element(self, name: str, via: Via | None, body: str, point: Any) -> Tag:
        """Return the element of a tendon for a point, or for an obstacle with its geom."""
        if via is None or via.radius is None:
            return Tag("site", site=self._site(body, name, point))
        geom = Tag("geom", name=self._free("geom", name), pos=tuple(point))
        if via.axis is None:
            geom.set(type="sphere", size=via.radius)
        else:
            turn = quaternion_of(frame_of(unit_vector(via.axis)))
            geom.set(type="cylinder", size=(via.radius, via.radius), quat=turn)
        geom.set(contype="0", conaffinity="0")
        self.sites.setdefault(body, []).append(geom)
        tag = Tag("geom", geom=geom.attributes["name"])
        if via.inner:
            tag.set(sidesite=self._site(body, f"{name} side", point))
        elif via.side is not None:
            tag.set(sidesite=self._site(body, f"{name} side", outside(via)))
        return tag

    def _tendon(self, f: Tendon) -> None:
        rest = f.rest
        if rest is None:
            rest = sum(x * self.model.body(name).q[k] for name, k, x in f.terms)
        numbers = {"stiffness": f.stiffness, "damping": f.damping, "frictionloss": f.friction}
        given: dict[str, Any] = {key: x for key, x in numbers.items() if x}
        if f.stiffness:
            given["springlength"] = rest
        if f.low is not None or f.high is not None:
            given["range"] = span(f.low, f.high)
        self._along(f.name, f, f"force '{f.name}'", **given)

    def _fluid(self) -> dict[str, float]:
        """Return MuJoCo's fluid if every body with mass has its drag, else {}."""
        forces = self.model.forces
        drags = [f for f in forces if isinstance(f, Drag) and not self._still(f.body)]
        kinds = {(f.density, f.viscosity) for f in drags}
        bodies = {b.name: b for b in self.model.bodies if b.mass and not self._still(b.name)}
        everywhere = sorted(f.body for f in drags) == sorted(bodies) and len(kinds) == 1
        if everywhere and all(_own_box(f, bodies[f.body]) for f in drags):
            density, viscosity = kinds.pop()
            return {"density": density, "viscosity": viscosity}
        for f in drags:
            self.out(
                f"force '{f.name}'", "a drag that does not apply to the inertia boxes of all bodies"
            )
        return {}

    def _actuators(self) -> Iterator[Tag]:
        for f in self.model.forces:
            where = f"force '{f.name}'"
            if isinstance(f, Wrench):
                if f.name not in self.lifting:
                    self.out(where, "a wrench")
            elif isinstance(f, OnJoint):
                yield from self._actuator(f, where)
            elif isinstance(f, LinearActuator):
                yield from self._along_path(f, where)
            elif isinstance(f, Muscle):
                yield from self._muscle(f, where)
            elif f._varies:
                self.out(where, f"an expression in a {f.kind}")
            elif isinstance(f, Strut) and not of_strut(f):
                self.out(where, "a strut by other tables than those of a spring or of a rope")
            elif not isinstance(f, (Spring, Strut, Tendon, Drag)):
                self.out(where, f"a {f.kind}")

    def _actuator(self, f: OnJoint, where: str) -> Iterator[Tag]:
        """Yield the actuator of a force, gain u + bias, with u = 0 in the file or near it."""
        gain, torque, kp, kd = f.law
        value = getattr(f, f.INPUT)
        if not isinstance(torque, float) or not isinstance(value, float):
            varies = str in (type(torque), type(value))
            self.out(where, "an expression" if varies else "a table over time")
            return
        low, high = f.inputs
        if f.integrates:
            given, first = 0.0, f.start or 0.0  # initial state, which is 0 in MuJoCo
            if value != min(max(0.0, low), high):
                self.out(where, f"its input {value:g} (MuJoCo starts at control 0)")
        else:
            given = first = self._given(f, where)
        one = Tag("general", name=f.name)
        if f.coefficients:
            if not (name := self._along(f"{f.name} tendon", _Ungeared(f), where)):
                return
            one.set(tendon=name)
        elif joint := self._joint(f.body, f.coordinate):
            one.set(joint=joint)
        else:
            self.out(where, "a force on a ball or free joint")
            return
        if f.lag:
            one.set(dyntype="filterexact", dynprm=(f.lag,))
            if f.start is not None and f.start != given:
                self.out(where, "what its lag starts from")
        if f.integrates:
            one.set(dyntype="integrator")
            least, most = f.states
            if np.isfinite(least) or np.isfinite(most):
                one.set(actrange=span(least - first, most - first))
        if f.gear != 1.0:
            one.set(gear=(f.gear, 0.0, 0.0, 0.0, 0.0, 0.0))
        bias = (torque + gain * first, -kp or 0.0, -kd or 0.0)
        one.set(gainprm=(gain,), biastype="affine", biasprm=bias)
        if f.input_low is not None or f.input_high is not None:
            one.set(ctrlrange=span(low - given, high - given))
        least, most = f.torques
        if np.isfinite(least) or np.isfinite(most):
            one.set(forcerange=span(least, most))
        yield one

    def _along_path(self, f: LinearActuator, where: str) -> Iterator[Tag]:
        """Yield the actuator of a tendon over sites and around geoms."""
        if not isinstance(f.input, float):
            self.out(where, "an expression" if isinstance(f.input, str) else "a table over time")
            return
        if f.name not in self.paths:  # reported with its path
            return
        given, (low, high) = self._given(f, where), f.inputs
        one = Tag("general", name=f.name, tendon=self.paths[f.name])
        one.set(gainprm=(f.gain,), biastype="affine")
        one.set(biasprm=(f.bias + f.gain * given, -f.kp or 0.0, -f.kd or 0.0))
        if np.isfinite(low) or np.isfinite(high):
            one.set(ctrlrange=span(low - given, high - given))
        if np.isfinite(f.forces).any():
            one.set(forcerange=span(*f.forces))
        yield one

    def _muscle(self, f: Muscle, where: str) -> Iterator[Tag]:
        """Yield the actuator of a muscle."""
        if f.name not in self.paths and f.model == "mujoco":  # reported with its path
            return
        if f.name not in self.paths:
            self.out(where, f"a muscle of model '{f.model}'; MuJoCo has its own alone")
            return
        if f.pennation or f.excitation != 0.0 or f.start or f.damping or f.weakest:
            self.out(where, "pennation, excitation, start, damping and weakest of a muscle")
        yield Tag("general", name=f.name, tendon=self.paths[f.name], **numbers_of(f))

    def _given(self, f: Driven, where: str) -> float:
        """Return the input that is a part of the bias, since MuJoCo starts at control 0."""
        low, high = f.inputs
        value = getattr(f, f.INPUT)
        given = 0.0 if value == min(max(0.0, low), high) else value
        if given:
            text = f"its input {value:g} is part of its bias: MuJoCo starts at control 0"
            self.report.add("converted", where, text, part=f.name)
        return given

    def _lifted(self) -> Iterator[tuple[str, str, float]]:
        """Yield wrenches that support a body's weight, with the body and the fraction."""
        g = np.array(self.model.gravity)
        for f in self.model.forces:
            if not isinstance(f, Wrench) or f.frame != "world" or not g.any():
                continue
            body = self.model.body(f.body)
            if (
                isinstance(f.force, tuple)
                and not f._varies
                and body.mass
                and f.point == body.com
                and f.torque == (0.0, 0.0, 0.0)
            ):
                part = -float(np.dot(f.force, g)) / float(g @ g) / body.mass
                if np.allclose(f.force, -part * body.mass * g):
                    yield f.name, f.body, part


class _Ungeared:
    """The sum on which a force acts, without its gear."""

    def __init__(self, f: OnJoint):
        self.terms = tuple((name, k, x / f.gear) for name, k, x in f.terms)


def of_strut(f: Strut) -> dict[str, Any]:
    """Return the numbers of the tendon that a strut is, or {} if none is.

    A tendon has one stiffness, up to a length and from another one on, and one damping.
    """
    (x, force, slope), turns = bends(f.spring)
    (still, drag, damping), others = bends(f.damper)
    if f.bump_stiffness or len(others) or drag != damping * still:
        return {}
    slopes = np.append(slope, slope + np.cumsum(turns[:, 1]))
    stiffness = float(slopes.max())
    flat, steep = (np.abs(slopes - k) <= SOLVED * stiffness for k in (0.0, stiffness))
    if stiffness < 0.0 or damping < 0.0 or not (flat | steep).all():
        return {}
    knots = [at for at, turn in turns.tolist() if abs(turn) > SOLVED * stiffness]
    if stiffness == 0.0:
        ends = () if force == 0.0 else None
    elif steep.all():
        rest = x - force / stiffness
        ends = (rest,) if rest >= 0.0 else None
    elif flat[0]:  # from the only knot on
        ends = (0.0, knots[0]) if force == 0.0 and len(knots) == 1 else None
    else:
        rests = abs(force - stiffness * (x - knots[0])) <= SOLVED * stiffness * abs(knots[0])
        ends = (knots[0], knots[1]) if rests and len(knots) == 2 else None
    if ends is None:
        return {}
    lengths = {"springlength": ends} if ends else {}
    return {"stiffness": stiffness, "damping": damping, **lengths}


def _own_box(f: Drag, body: Body) -> bool:
    """Check whether a drag matches MuJoCo's inertia box for its body."""
    moments, axes = np.linalg.eigh(np.array(body.inertia))
    edges = np.sqrt(np.maximum(moments.sum() - 2 * moments, 0.0) / body.mass * 6)
    turn = matrix(unit(f.rotation))
    mine = turn @ np.diag(np.array(f.size) ** 2) @ turn.T
    box = axes @ np.diag(edges**2) @ axes.T
    return bool(np.allclose(mine, box, rtol=1e-9, atol=1e-12)) and f.point in (None, body.com)


def outside(via: Via) -> tuple[float, ...]:
    """Return the side of an obstacle as a point outside, since MuJoCo goes through it otherwise."""
    assert via.side is not None, "it lies on the side of a point"
    assert via.radius is not None, "it is round"
    apart = np.subtract(via.side, via.point)
    if via.axis is not None:
        u = unit_vector(via.axis)
        apart = apart - (u @ apart) * u
    far = float(np.linalg.norm(apart))
    return tuple((np.array(via.point) + apart * max(1.0, 2.0 * via.radius / far)).tolist())
