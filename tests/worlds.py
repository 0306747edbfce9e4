"""Models and parts that several test files share."""

from __future__ import annotations

from typing import Any

import numpy as np

import pgraph_core as pg

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
