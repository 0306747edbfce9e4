"""Each field of a body, a shape, a contact and the ground, in files of other formats.

A change of a field changes the file, or the report names the part, the field and the value. A field
with neither moves nothing here either.
"""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.fields import GROUND

pytestmark = pytest.mark.quick

SPHERE = pg.Shape(kind="sphere", radius=0.1)
LONG = {"radius": 0.1, "length": 0.3}
TETRAHEDRON = "v 0 0 0\nv .2 0 0\nv 0 .2 0\nv 0 0 .2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
SOLID = {"mass": 1.0, "inertia": (0.01, 0.01, 0.01)}
SLIDES = {"joint": "prismatic", "axes": (1, 0, 0), "v": (2.0,)}
HOME = (0, 0, 0, 1, 0, 0, 0)
FREE = {"joint": "free", "q": (0, 0, 3, 1, 0, 0, 0), "v": (0, 0, 5, 1, 0, 0)}
HELD = SLIDES | {"limits": ((-0.2, 0.2),)}
TRACK = {"points": [[0, 0, 0], [1, 0, 0.5]]}
COMPOUND = {"joint": "compound", "motions": [("rotate", (0, 1, 0))]}
DRAWN = {"role": "visual"}

# field: (what else is given, its value before, its value after), a row for each form of the field
CONTACT = {
    "name": [({}, "c", "d")],
    "body": [({}, "b", "s")],
    "other": [({}, GROUND, "s")],
    "law": [({}, "complementarity", "soft"), ({}, "complementarity", "penalty")],
    "friction": [({}, 0.2, 0.9), ({}, None, 0.9), ({}, 0.2, "=0.5 + 0.1*sin(t)")],
    "static_friction": [({"friction": 0.2}, None, 0.75)],
    "rolling_friction": [({}, None, 0.02)],
    "spinning_friction": [({}, None, 0.02)],
    "restitution": [({}, None, 0.75), ({"law": "soft"}, None, 0.75)],
    "stiffness": [({"law": "penalty"}, None, 8000.0)],
    "damping": [({"law": "penalty", "stiffness": 1e4}, None, 7.0)],
    "points": [({}, (), ((0, 0, -0.1),))],
    "active": [({}, True, False)],
}
GROUNDS = {
    "slope": [({}, 0.0, 0.1)],
    "uphill": [({"slope": 0.1}, None, (0, 1, 0))],
    "friction": [({}, 0.5, 0.9)],
    "static_friction": [({"friction": 0.2}, None, 0.75)],
    "rolling_friction": [({}, 0.0, 0.02)],
    "spinning_friction": [({}, 0.0, 0.02)],
    "restitution": [({}, 0.0, 0.75)],
    "steps": [({}, (), ({"low": (-1, -1), "high": (1, 1), "height": 0.1},))],
}
BODY = {
    "name": [({}, "x", "y")],
    "parent": [({}, GROUND, "s")],
    "joint": [({}, "revolute", "weld"), ({}, "revolute", "spherical")],
    "axes": [({}, (0, 1, 0), (1, 0, 0))],
    "motions": [(COMPOUND, COMPOUND["motions"], [("rotate", (1, 0, 0))])],
    "link": [({}, (0, 0, 0), (0, 0, 0.5))],
    "rotation": [({}, (1, 0, 0, 0), (0.8, 0.6, 0, 0))],
    "mass": [({}, 1.0, 2.0)],
    "com": [({}, (0.3, 0, 0), (0.3, 0.1, 0))],
    "inertia": [({}, (0.01, 0.01, 0.01), (0.01, 0.02, 0.02))],
    "tip": [({}, None, (1, 0, 0))],
    "q": [({}, (0.0,), (0.3,)), ({"joint": "free"}, HOME, (1, *HOME[1:]))],
    "v": [({}, (0.0,), (0.3,)), ({"joint": "free"}, (0,) * 6, (1, 0, 0, 0, 0, 0))],
    "stiffness": [({}, 0.0, 3.0)],
    "damping": [({}, 0.0, 0.25), (FREE, 0.0, 0.25)],
    "rest": [({"stiffness": 3.0}, 0.0, 0.5), ({}, 0.0, 0.5)],
    "friction": [({}, 0.0, 0.25), (FREE, 0.0, 0.25)],
    "armature": [({}, 0.0, 0.25)],
    "limits": [(SLIDES, (), ((-0.2, 0.2),))],
    "limit_restitution": [(HELD, 0.0, 0.75), (SLIDES, 0.0, 0.75)],
    "speed_limit": [({}, 0.0, 4.0)],
    "pitch": [({"joint": "screw"}, 0.01, 0.02)],
    "track": [({"joint": "curve"}, TRACK, {"points": [[0, 0, 0], [1, 0, 0.25]]})],
    "shape": [({}, None, SPHERE)],
    "shapes": [({}, (), (SPHERE, SPHERE))],
    "density": [({"shape": SPHERE, "mass": None, "derived": ("mass",)}, 100.0, 200.0)],
    "derived": [({"shape": SPHERE, "com": (0, 0, 0)}, (), ("com",))],
    "any_inertia": [({}, False, True)],
}
SHAPE = {
    "kind": [({"kind": None, **LONG}, "cylinder", "capsule")],
    "size": [({"kind": "box"}, (0.2, 0.2, 0.2), (0.2, 0.2, 0.3))],
    "radius": [({"kind": "sphere"}, 0.1, 0.2)],
    "radii": [({"kind": "ellipsoid"}, (0.1, 0.1, 0.2), (0.1, 0.2, 0.2))],
    "heights": [({"kind": "heightfield", "size": (1, 1, 0.1)}, ((0, 0), (0, 0)), ((0, 1), (0, 0)))],
    "length": [({"kind": "cylinder", "radius": 0.1}, 0.3, 0.4)],
    "end_radius": [
        ({"kind": "cylinder", **LONG}, None, 0.05),
        ({"kind": "cylinder", **LONG, **DRAWN}, None, 0.05),
        ({"kind": "capsule", **LONG, **DRAWN}, None, 0.05),
    ],
    "file": [({"kind": "mesh", "hull": "convex"}, "one.obj", "two.obj")],
    "scale": [({"kind": "mesh", "hull": "convex", "file": "one.obj"}, 1.0, 2.0)],
    "hull": [({"kind": "mesh", "file": "one.obj"}, "convex", "parts")],
    "position": [({}, (0, 0, 0), (0, 0, 0.1))],
    "rotation": [({"kind": "cylinder", **LONG}, (1, 0, 0, 0), (0.8, 0.6, 0, 0))],
    "role": [({}, "both", "visual"), ({}, "both", "collision")],
    "colour": [({}, None, (1, 0, 0))],
    "opacity": [({}, 1.0, 0.5)],
    "surface_velocity": [({}, (0, 0, 0), (1, 0, 0))],
    "surface_spin": [({}, (0, 0, 0), (0, 0, 1))],
}
CLASSES = {pg.Contact: CONTACT, pg.Ground: GROUNDS, pg.Body: BODY, pg.Shape: SHAPE}
ROWS = [
    (kind, field, *row)
    for kind, table in CLASSES.items()
    for field, rows in table.items()
    for row in rows
]
STILL = {  # fields that a file may lack in silence, since no run depends on them
    "Contact.name", "Body.tip", "Body.rest", "Body.limit_restitution", "Body.any_inertia",
    "Body.derived",
}  # fmt: skip


def made(kind, folder, fields) -> pg.Model:
    """A model with a part of these fields: a ball that falls, a slider and the part's body."""
    fields = {name: value for name, value in fields.items() if value is not None}
    ball = pg.Body(name="b", joint="free", link=(0, 0, 0.15), shape=SPHERE, **SOLID)
    slider = pg.Body(name="s", joint="prismatic", link=(0, 3, 1), shape=SPHERE, **SOLID)
    bodies, contact = [ball, slider], {"name": "c", "body": "b"}
    ground = fields if kind is pg.Ground else {}
    if kind is pg.Contact:
        contact |= fields
    if kind is pg.Body:
        turns = {"axes": (0, 1, 0)} if fields.get("joint", "revolute") == "revolute" else {}
        bodies.append(pg.Body(**{"name": "x", "com": (0.3, 0, 0), **turns, **fields}))
    if kind is pg.Shape:
        if "file" in fields:
            fields["file"] = str(folder / fields["file"])
        own = fields if "kind" in fields else {"kind": "sphere", "radius": 0.1, **fields}
        bodies.append(pg.Body(name="x", link=(0, 0, 0.5), shape=own, **SOLID))
    return pg.Model(bodies=bodies, contacts=[contact], ground=ground)


def outcome(model, path):
    """The text of a file and its report, or the refusal."""
    path.unlink(missing_ok=True)
    try:
        report = (pg.write_mjcf if path.suffix == ".xml" else pg.write_urdf)(model, path)
    except pg.ModelError as refused:
        return str(refused), None
    return path.read_text(), report


def test_the_tables_have_all_fields():
    for kind, table in CLASSES.items():
        assert [*table] == [name for name in kind.model_fields if name != "dof"]


@pytest.mark.parametrize("suffix", [".xml", ".urdf"])
@pytest.mark.parametrize(("kind", "field", "given", "before", "after"), ROWS)
def test_a_field_is_written_or_told_or_moves_nothing(
    kind, field, given, before, after, suffix, tmp_path
):
    for name in ("one", "two"):
        (tmp_path / f"{name}.obj").write_text(TETRAHEDRON.replace(".2", f".{len(name)}"))
    models = [made(kind, tmp_path, {**given, field: value}) for value in (before, after)]
    (text, report), (changed, other) = (outcome(m, tmp_path / f"m{suffix}") for m in models)
    if other is None:  # refused, by the name of the body
        assert "body 'x', joint" in changed
        return
    if report is None or changed != text:
        return
    said = {str(entry) for entry in report.entries}
    told = [entry for entry in other.entries if str(entry) not in said]
    parts = {pg.Contact: "contact 'c'", pg.Ground: GROUND}
    part, lost = parts.get(kind, "body 'x'"), [*other.of("left out")]
    if suffix == ".urdf" and (kind in (pg.Contact, pg.Ground) or field == "hull"):
        assert [e.acts for e in lost if "a contact, which" in e.text] == [True]
    elif suffix == ".urdf" and field in ("q", "v"):
        assert [e for e in lost if "the initial state of " in e.text and "x: " in e.text]
    elif told:
        words = " ".join(f"{entry.where}: {entry.text}" for entry in told)
        assert part in words
        if isinstance(after, (int, float)) and after is not True:
            assert f"{field} {after:g}" in words
    elif kind is pg.Shape:  # the whole shape
        assert [e for e in lost if e.where == part and given["kind"] in e.text and e.acts]
    else:
        assert f"{kind.__name__}.{field}" in STILL
        runs = [pg.simulate(m, t_end=0.3, estimate=False) for m in models]
        assert np.array_equal(runs[0].q, runs[1].q)
