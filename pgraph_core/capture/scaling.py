"""Scaling of a model to a person, by distances of markers in a static trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, Problem, choices, explained, refusal, shown
from ..fields import GROUND
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..tolerances import NOTABLE
from .trial import Array, Trial, known

FRAMES = {"point": "body", "points": "body", "side": "body", "other_point": "other"}
SHIFTS = {"shifts": "body", "other_shifts": "other"}  # displacements of points, in these axes
LENGTHS = ("radius", "length", "end_radius", "size", "radii", "scale")  # fields of shapes
ALONG = ("l_opt", "l_slack")  # lengths of muscles, which grow with their paths
AXES = ("x", "y", "z")


@explained
@dataclass(frozen=True, eq=False)
class Scaling:
    """The factors of a scaled model, and the distances that they follow from."""

    factors: Mapping[str, tuple[float, float, float]]  # by body, along its axes
    pairs: Mapping[str, tuple[tuple[str, str, float, float], ...]]
    """{body: ((site, site, distance in the trial [m], in the model [m]), ...)}."""
    mass: float  # [kg]
    report: tuple[str, ...]

    def __repr__(self) -> str:
        lines = [f"<Scaling: {self.mass:.6g} kg"]
        for body, (x, y, z) in self.factors.items():
            if body in self.pairs:
                lines.append(f"{body}: {x:.4g}, {y:.4g}, {z:.4g} along x, y, z")
            for a, b, there, here in self.pairs.get(body, ()):
                lines.append(f"  {a} to {b}: {there:.4g} m, {here:.4g} m in the model, "
                             f"factor {there / here:.4g}")  # fmt: skip
        return "\n  ".join((*lines, *self.report)) + ">"


@explained
def scale(
    model: Model | Mechanism,
    static: Trial,
    *,
    pairs: Mapping[str, Any],
    markers: Mapping[str, str] | None = None,
    mass: float | None = None,
) -> tuple[Model, Scaling]:
    """Scale the bodies of a model to a person.

    The factor of a body is the mean ratio of distances between sites, in the static trial and in
    the initial position of the model. Links, mass centres, sites, shapes, points of forces and
    constraints and curves of joints scale with their body, and lengths of muscles with their paths.
    Masses scale with the volumes, and inertias with both.

    Parameters
    ----------
    model : Model or Mechanism
        The model, with sites.
    static : Trial
        A trial of a person who stands still. Distances are medians over its frames.
    pairs : dict
        Pairs of sites by body, {"femur": [("RASI", "RKNE")]}, for all axes of the body, or for some
        of them, {"femur": {"y": [("RASI", "RKNE")], "xz": [("RKNE", "RKNM")]}}.
    markers : dict, optional
        Labels by name of site, of markers with other names.
    mass : float, optional
        Mass of the person [kg], by default that of the model.

    Returns
    -------
    Model, Scaling
        The scaled model, and its factors with the distances.

    Raises
    ------
    InputError
        If a body, site or marker is not there, or no pair is given.

    Examples
    --------
        scaled, report = pg.scale(model, static, pairs={"femur_r": [("RASI", "RKNE")]}, mass=72)
    """
    mech = mechanism_of(model, "scale")
    if not isinstance(static, Trial):
        text = f"must be a trial, as of pg.read_trial(path), got {shown(static)}"
        raise refusal("scale", "static", text)
    if not (mass is None or (isinstance(mass, (int, float)) and 0.0 < mass < np.inf)):
        raise refusal("scale", "mass", f"must be > 0 [kg], got {shown(mass)}")
    if not isinstance(pairs, Mapping) or not pairs:
        text = "needs a pair of sites for a body, {'femur': [('RASI', 'RKNE')]}, got "
        raise refusal("scale", "pairs", text + shown(pairs))
    factors, told = {name: np.ones(3) for name in mech.names}, {}
    poses = mech.pose(mech.home()[0])
    for body, given in pairs.items():
        known("scale", "pairs", "body", body, factors)
        by_axes = given if isinstance(given, Mapping) else {"xyz": given}
        measured: list[tuple[str, str, float, float]] = []
        for axes, listed in by_axes.items():
            if not axes or set(axes) - set(AXES):
                text = f"the axes of '{body}' are of x, y and z, such as 'xz', got {shown(axes)}"
                raise refusal("scale", "pairs", text)
            found = [_measured(mech, static, poses, body, pair, markers or {}) for pair in listed]
            if not found:
                text = f"'{body}' has no pair of sites; give one, or leave the body out"
                raise refusal("scale", "pairs", text)
            ratio = float(np.mean([there / here for _, _, there, here in found]))
            factors[body][[AXES.index(axis) for axis in axes]] = ratio
            measured += found
        told[body] = tuple(measured)
    report = [
        f"without a pair, and as they were: {choices([x for x in mech.names if x not in told])}"
    ]
    scaled = _scaled(mech, factors, mass, report)
    return scaled, Scaling(
        {name: (float(x[0]), float(x[1]), float(x[2])) for name, x in factors.items()}, told,
        float(sum(body.mass for body in scaled.bodies)),
        tuple(report if len(told) < mech.nb else report[1:]),
    )  # fmt: skip


def _measured(
    mech: Mechanism, static: Trial, poses: Any, body: str, pair: Any, labels: Mapping[str, str]
) -> tuple[str, str, float, float]:
    """Return a pair of sites with its distances in the trial and in the model [m]."""
    sites = [s.name for s in mech.model.sites]
    if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
        text = f"a pair of '{body}' is two sites, such as ('RASI', 'RKNE'), got {shown(pair)}"
        raise refusal("scale", "pairs", text)
    places: list[Array] = []
    for name in pair:
        label = labels.get(name, name)
        known("scale", "pairs", f"site of '{body}'", name, sites)
        known("scale", "pairs", "marker of the trial", label, static.markers)
        places.append(static.markers[label])
    apart = np.linalg.norm(places[0] - places[1], axis=1)
    if not np.isfinite(apart).any():
        text = f"'{pair[0]}' and '{pair[1]}' are never seen together in the trial"
        raise refusal("scale", "pairs", text)
    here = float(np.linalg.norm(poses[pair[0]].position - poses[pair[1]].position))
    if here == 0.0:
        text = f"'{pair[0]}' and '{pair[1]}' are at the same place in the model"
        raise refusal("scale", "pairs", text)
    return pair[0], pair[1], float(np.nanmedian(apart)), here


# -- parts -----------------------------------------------------------------------------------------


def _scaled(
    mech: Mechanism, factors: Mapping[str, Array], mass: float | None, report: list[str]
) -> Model:
    """Return the model with scaled parts."""
    model, by = mech.model, {**factors, GROUND: np.ones(3)}
    volume = {name: float(np.prod(x)) for name, x in by.items()}
    before = sum(body.mass for body in model.bodies)
    after = sum(body.mass * volume[body.name] for body in model.bodies)
    share = (before if mass is None else mass) / after if after else 1.0
    bodies = [_body(body, by, share * volume[body.name]) for body in model.bodies]
    found: dict[str, Any] = {"bodies": bodies}
    for kind in ("sites", "contacts", "constraints", "forces"):
        found[kind] = [_part(part, by) for part in getattr(model, kind)]
        bent = [p.name for p in found[kind] if hasattr(p, "curve")]
        if bent:
            report.append(f"curves that were not scaled: {choices(bent)}")
    changed = model.replace(**found)
    paths = dict(zip(mech.path_names, mech.path_length(mech.home()[0])))
    if any(hasattr(force, ALONG[0]) for force in model.forces):
        new = Mechanism(changed)
        grown = dict(zip(new.path_names, new.path_length(new.home()[0])))
        forces = [
            force.model_copy(update={
                name: getattr(force, name) * grown[force.name] / paths[force.name]
                for name in ALONG
            }) if hasattr(force, ALONG[0]) else force
            for force in changed.forces
        ]  # fmt: skip
        changed = changed.replace(forces=forces)
    return changed


def _body(body: Any, by: Mapping[str, Array], heavier: float) -> Any:
    """Return a scaled body, with `heavier` times its mass."""
    own, parent = by[body.name], by[body.parent]
    inertia = np.array(body.inertia)
    spread = np.trace(inertia) / 2 * np.eye(3) - inertia  # second moments of the mass
    spread = heavier * own[:, None] * spread * own
    update: dict[str, Any] = {
        "link": tuple(parent * body.link), "com": tuple(own * body.com), "derived": (),
        "mass": heavier * body.mass, "inertia": (np.trace(spread) * np.eye(3) - spread).tolist(),
        "density": None, "shapes": tuple(_shape(shape, own) for shape in body.shapes),
    }  # fmt: skip
    if body.tip is not None:
        update["tip"] = tuple(own * body.tip)
    if body.track is not None:
        update["track"] = _track(body, parent)
    return body.model_copy(update=update)


def _shape(shape: Any, own: Array) -> Any:
    """Return a scaled shape. One that is turned, or round, grows evenly where its body does not."""
    mean = float(np.prod(own)) ** (1 / 3)
    update: dict[str, Any] = {"position": tuple(own * shape.position)}
    even = np.ptp(own) <= NOTABLE or abs(shape.rotation[0]) < 1.0
    for name in LENGTHS:
        value = getattr(shape, name)
        if value is None or (name == "scale" and not shape.file):
            continue
        by = mean if even or name not in ("size", "scale") else own
        value = np.asarray(value, float) * by
        update[name] = tuple(value.tolist()) if value.ndim else float(value)
    return shape.model_copy(update=update)


def _track(body: Any, parent: Array) -> Any:
    """Return the scaled curve of a joint. Raises InputError."""
    if np.ptp(parent) > NOTABLE and abs(body.rotation[0]) < 1.0:
        text = "has a curve that is turned, so that its parent cannot grow by different factors; "
        raise InputError(Problem("scale", f"body '{body.name}'", f"{text}give one for all axes"))
    if body.track.points:
        points = tuple(tuple((parent * p).tolist()) for p in body.track.points)
        return body.track.model_copy(update={"points": points})
    update: dict[str, Any] = {}
    for axis, by in zip(AXES, parent.tolist()):
        value = getattr(body.track, axis)
        if isinstance(value, str):
            update[axis] = f"({value})*{by!r}"
        elif isinstance(value, (int, float)):
            update[axis] = by * value
        else:  # (q, value) or (q, value, slope)
            update[axis] = tuple((row[0], *(by * x for x in row[1:])) for row in value)
    return body.track.model_copy(update=update)


def _part(part: Any, by: Mapping[str, Array]) -> Any:
    """Return a part with its points scaled in the axes of their bodies."""
    update: dict[str, Any] = {}
    for name, of in FRAMES.items():
        value, body = getattr(part, name, None), getattr(part, of, GROUND)
        if value is not None and body in by and len(value):
            scaled = by[body] * np.array(value)
            update[name] = tuple(map(tuple, scaled.tolist())) if scaled.ndim > 1 else tuple(scaled)
    for places in getattr(part, "PLACES", ()):
        update[places] = tuple(_part(place, by) for place in getattr(part, places))
    for name, of in SHIFTS.items():
        own = by.get(getattr(part, of, GROUND))
        if own is not None and getattr(part, name, ()):
            update[name] = tuple(
                shift.model_copy(update={"along": tuple(own * shift.along)})
                for shift in getattr(part, name)
            )
    own = by.get(getattr(part, "body", GROUND))
    for name in ("radius", "radii"):  # those of round obstacles grow evenly
        if own is not None and (value := getattr(part, name, None)) is not None:
            grown = np.asarray(value, float) * float(np.prod(own)) ** (1 / 3)
            update[name] = tuple(grown.tolist()) if grown.ndim else float(grown)
    return part.model_copy(update=update) if update else part
