"""Models and parts that several test files share."""

from typing import Any

import numpy as np

import pgraph_core as pg
import pgraph_models

# -- contact: free bodies of 1 kg and models in which one touches the ground


def ball(name: str = "b", place: Any = (0, 0, 0.1), radius: float = 0.1, **more: Any) -> pg.Body:
    """A free solid ball."""
    inertia = 0.4 * more.get("mass", 1.0) * radius**2 * np.eye(3)
    given = {"joint": "free", "link": tuple(place), "inertia": inertia, **more}
    return pg.Body(name=name, shape={"kind": "sphere", "radius": radius}, **given)


def box(name: str = "b", place: Any = (0, 0, 0.1), size: Any = (0.2,) * 3, **more: Any) -> pg.Body:
    """A free solid box."""
    given = {"joint": "free", "link": tuple(place), "derived": ("inertia",), "mass": 1.0, **more}
    return pg.Body(name=name, shape={"kind": "box", "size": tuple(size)}, **given)


def on_ground(*bodies: pg.Body, model: dict[str, Any] | None = None, **law: Any) -> pg.Model:
    """A model whose bodies touch the ground: contact `floor`, or the name of each of several."""
    contacts = tuple(
        pg.Contact(name="floor" if len(bodies) == 1 else b.name, body=b.name, **law) for b in bodies
    )
    return pg.Model(bodies=bodies, contacts=contacts, **(model or {}))


# -- messages: the fields that a part of each kind cannot do without

NEEDS: dict[str, dict[str, Any]] = {
    "distance": {"other_point": (0, 0, 9)},
    "line": {"axis": (0, 0, 1)},
    "curve_point": {"curve": [(0, 0, 0), (1, 0, 0)]},
    "plane": {"axis": (0, 0, 1)},
    "gear": {"other": "1"},
    "relation": {"other": "1", "curve": "=q"},
    "cam": {
        "other": "1",
        "motion": [{"lift": 0.1, "angle": 3.0}, {"lift": 0.0}],
        "base_radius": 0.1,
        "distance": 0.3,
        "arm": 0.25,
    },
    "rope": {"through": ["2", ("ground", (0, 0, 9))]},
    "cable": {"through": ["2", ("ground", (0, 0, 9))]},
    "motion": {"q_of_t": {"kind": "sine"}},
    "rolling": {"radius": 1.0},
    "skate": {"axis": (0, 0, 1)},
    "velocity": {"coefficients": {"2": 1.0}},
    "coupling": {"coefficients": {"2": 1.0}},
    "tendon": {"coefficients": {"2": 1.0}},
    "drag": {"size": (1, 2, 3)},
    "muscle": {"f_max": 9.0, "l_opt": 0.1, "l_slack": 0.1},
}
KINDS = [(part, kind) for part in (pg.Constraint, pg.Force) for kind in part.KINDS]
FOOTFALLS = [{"foot": foot, "offset": 0.0, "duty": 0.5} for foot in "abcd"]
WHOLE: dict[type, dict[str, Any]] = {
    pg.Model: {},
    pg.Body: {"name": "x"},
    pg.Contact: {"name": "x", "body": "2"},
    pg.Scenario: {"name": "x"},
    pg.Beam: {"name": "x", "length": 1.0, "EI": 1.0, "rho_a": 1.0},
    pg.Site: {"name": "x", "body": "2"},
    pg.Output: {"name": "x", "kind": "force", "at": "2"},
    pg.Gait: {"name": "x", "feet": FOOTFALLS},
    pg.Footfall: FOOTFALLS[0],
    pg.Gains: {},
    pg.Ground: {},
    pg.Step: {"low": (0, 0), "high": (1, 1), "height": 1},
    pg.Switch: {"t": 1, "constraint": "c", "active": True},
    pg.Table: {"t": (0, 1), "value": (0, 1)},
    pg.VectorTable: {"t": (0,), "value": ((0, 0, 0),)},
    pg.Sine: {},
    pg.Polynomial: {"coefficients": (1,)},
    pg.Curve: {"x": (0, 1), "value": (0, 1)},
    **{part.KINDS[kind]: {"name": "x", "body": "2", **NEEDS.get(kind, {})} for part, kind in KINDS},
}


# -- built-in models, and heaps


def built_in(name: str) -> pg.Mechanism:
    """The mechanism of a built-in model."""
    return pg.Mechanism(pg.Model.load(pgraph_models.path(name)))


def heaped(bodies: Any, **law: Any) -> pg.Model:
    """Bodies that touch the ground, by contact `floor`, and each other, by contact `heap`."""
    floor, heap = (
        pg.Contact(name="floor", body="*", **law),
        pg.Contact(name="heap", body="*", other="*", **law),
    )
    return pg.Model(bodies=tuple(bodies), contacts=(floor, heap))
