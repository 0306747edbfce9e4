"""Kinds of shapes by their contract: what each answers about its geometry, pictures and files."""

import ast
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_core.model.shape import corners_of
from pgraph_core.rotation import unit
from pgraph_core.shapes import KINDS, SIZES, Sized, kind_of, picture_of
from pgraph_core.shapes.contract import Geom, Kind, Picture, Primitive, Surface
from pgraph_core.shapes.rays import Ray
from pgraph_core.show import notebook, shapes

from .comparisons import sources

pytestmark = pytest.mark.quick

TURN = unit((0.8, 0.1, 0.5, 0.3))
HEIGHTS = ((0.0, 0.1, 0.2), (0.3, -0.1, 0.05), (0.2, 0.2, 0.1))
SAMPLES = [
    {"kind": "box", "size": (0.1, 0.2, 0.3)},
    {"kind": "sphere", "radius": 0.3},
    {"kind": "ellipsoid", "radii": (0.1, 0.2, 0.3)},
    {"kind": "cylinder", "radius": 0.1, "length": 0.7},
    {"kind": "cylinder", "radius": 0.1, "length": 0.7, "end_radius": 0.04},
    {"kind": "capsule", "radius": 0.1, "length": 0.7},
    {"kind": "capsule", "radius": 0.1, "length": 0.7, "end_radius": 0.15, "role": "visual"},
    {"kind": "mesh", "file": "", "scale": (2.0, 1.0, 0.5), "hull": "convex"},
    {"kind": "heightfield", "size": (4.0, 3.0, 0.5), "heights": HEIGHTS},
]  # fmt: skip
ROUND = 0.02  # of a size: facets of round solids that are drawn, and points of their outlines


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A mesh that is not centred at its origin."""
    path = tmp_path_factory.mktemp("meshes") / "part.stl"
    solid = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    solid.apply_translation((0.2, 0.5, -0.3))
    solid.export(path)
    return str(path)


@pytest.fixture(params=SAMPLES, ids=lambda fields: f"{fields['kind']} of {len(fields)} fields")
def shape(request, file):
    fields = request.param
    own = {"file": file} if "file" in fields else {}
    return pg.Shape(**{**fields, **own}, position=(0.1, 0.2, -0.3), rotation=TURN)


@pytest.fixture
def piece(shape):
    (found,) = shapes.pieces(
        pg.Body(name="a", shape=shape.unchecked_copy({"colour": (1, 0, 0)})), ()
    )
    return found


def test_every_kind_has_a_sample():
    assert {fields["kind"] for fields in SAMPLES} == set(KINDS)


@pytest.mark.parametrize("contract", [Kind, Sized, Geom, Picture, Surface, Primitive])
def test_a_kind_that_lacks_an_answer_is_refused_when_it_is_made(contract):
    """All kinds are made on import, so that no run meets an answer that is missing."""
    missing = contract.__abstractmethods__
    assert missing
    with pytest.raises(TypeError) as refused:
        type("Lacking", (contract,), {"name": "lacking"})()
    assert all(name in str(refused.value) for name in missing)


def test_a_kind_that_edges_do_not_make_says_where_its_shapes_are_from():
    assert all(isinstance(kind, Sized) != bool(kind.elsewhere) for kind in KINDS.values())


def test_a_shape_is_made_by_the_name_of_its_kind_and_its_sizes_in_order(shape):
    kind = kind_of(shape)
    sizes = [getattr(shape, name) for name in kind.needs]
    made = getattr(pg, kind.name.capitalize())(*sizes)
    assert made == pg.Shape(kind=kind.name, **dict(zip(kind.needs, sizes)))


def test_a_shape_has_the_sizes_of_its_kind_alone(shape):
    kind = kind_of(shape)
    assert set(kind.needs) <= {name for name in SIZES if getattr(shape, name) is not None}
    for name in set(SIZES) - {*kind.needs, *kind.may}:
        assert getattr(shape, name) is None
    assert set(kind.optional(shape)) <= set(kind.may)


def test_the_box_of_a_shape_encloses_tightly_what_is_drawn(shape, piece):
    """Also in its own axes, and as the outline of a picture."""
    drawn = np.asarray(shapes.mesh((piece,)).vertices)
    own = (drawn - piece.position) @ piece.rotation
    size = np.ptp(own, axis=0)
    given = (corners_of(shape) - piece.position) @ piece.rotation
    outline = (notebook.outline(piece) - piece.position) @ piece.rotation
    for found in (picture_of(piece).bounds(piece), given, outline):
        room = np.stack((own.min(axis=0) - found.min(axis=0), found.max(axis=0) - own.max(axis=0)))
        assert (room >= -ROUND * size).all()
        if (
            shape.end_radius is None or found is not given
        ):  # that of a taper is as if it were straight
            assert (room <= ROUND * size).all()


def test_the_hull_of_the_rounds_of_a_solid_has_its_box(shape):
    """Impacts on the ground are located on these ellipsoids, discs and points."""
    if shape.role == "visual":
        return
    (solid,) = kind_of(shape).solids(shape)
    if solid.rounds is None:
        return
    centres, axes = solid.rounds
    far = np.linalg.norm(axes, axis=1)
    (half, middle), low, high = solid.box, (centres - far).min(axis=0), (centres + far).max(axis=0)
    np.testing.assert_allclose(low, middle - half, atol=1e-12)
    np.testing.assert_allclose(high, middle + half, atol=1e-12)


def test_rays_meet_what_is_drawn(piece):
    kind = picture_of(piece)
    middle, rng = kind.bounds(piece).mean(axis=0), np.random.default_rng(1)
    size = float(np.ptp(kind.bounds(piece), axis=0).max())
    for way in rng.normal(size=(20, 3)):
        ray = Ray(middle - 20.0 * way, way / np.linalg.norm(way), 0.0)
        exact = [hit.far for hit in kind.meetings(piece, ray)]
        drawn = [hit.far for hit in Picture.meetings(kind, piece, ray)]
        assert bool(exact) == bool(drawn)
        if exact:
            assert min(exact) == pytest.approx(min(drawn), abs=ROUND * size)


def test_marks_of_a_piece_are_within_its_box(piece):
    low, high = picture_of(piece).bounds(piece)
    for place, what, _ in picture_of(piece).marks(piece):
        assert what
        assert (low - 1e-12 <= place).all()
        assert (place <= high + 1e-12).all()


@pytest.mark.parametrize("plane", range(3))
def test_the_mirror_image_of_a_shape_reaches_as_far_as_the_shape_in_the_mirror(shape, plane):
    """In every direction."""
    sign = np.where(np.arange(3) == plane, -1.0, 1.0)
    body = pg.Body(name="left", shape=shape, mass=1.0)
    image = pg.Model(bodies=[body]).mirror("left", "xyz"[plane]).body("right")
    own, other = (
        np.asarray(shapes.mesh([p for p in shapes.pieces(b, ()) if not p.color][:1]).vertices)
        for b in (body, image)
    )
    ways = np.random.default_rng(2).normal(size=(30, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    size = np.ptp(own, axis=0).max()
    far = (other @ ways.T).max(axis=0), (own @ (sign * ways).T).max(axis=0)
    np.testing.assert_allclose(*far, atol=ROUND * size)


def test_a_shape_that_fits_the_box_of_another_has_its_edges(shape):
    kind = kind_of(shape)
    if isinstance(kind, Sized):
        fields = kind.fitted(kind.edges(shape))
        assert set(fields) == set(kind.needs)
        again = pg.Shape(kind=kind.name, **fields)
        np.testing.assert_allclose(kind.edges(again), kind.edges(shape))


def test_a_geom_of_mujoco_is_the_shape_it_was(shape):
    kind = kind_of(shape)
    if isinstance(kind, Geom) and (found := kind.mjcf(shape)):
        _, size = found
        fields = kind.of_mjcf(*(*size, 0.0, 0.0)[:3])
        assert set(fields) == set(kind.needs)
        for name, value in fields.items():
            np.testing.assert_allclose(value, getattr(shape, name))


@pytest.mark.parametrize("suffix", ["urdf", "mjcf"])
def test_a_shape_is_written_or_named(shape, suffix, tmp_path):
    """What is read again has the box of the shape that was written."""
    if shape.file:
        (tmp_path / "part.stl").write_bytes(Path(shape.file).read_bytes())
        shape = shape.unchecked_copy({"file": str(tmp_path / "part.stl")})
    body = {"name": "a", "joint": "free", "mass": 1.0, "inertia": np.eye(3), "shapes": (shape,)}
    path = tmp_path / f"a.{suffix}"
    report = getattr(pg, f"write_{suffix}")(pg.Model(bodies=[body]), path)
    shapes_again = pg.load(path).bodies[-1].shapes
    if not shapes_again:
        assert f"a {shape.kind}" in str(report)
        return
    boxes = [np.concatenate([corners_of(s) for s in own]) for own in ([shape], shapes_again)]
    if shape.end_radius is None:
        for one, again in zip(*((box.min(axis=0), box.max(axis=0)) for box in boxes)):
            np.testing.assert_allclose(one, again, atol=1e-6)


def compared(tree):
    """Yield (line, constants) where a `kind` is compared with constants, or matched with them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(isinstance(x, ast.Attribute) and x.attr == "kind" for x in sides):
                inside = [x for side in sides for x in ast.walk(side)]
                yield node.lineno, {x.value for x in inside if isinstance(x, ast.Constant)}
        elif isinstance(node, ast.Match):
            subject = node.subject
            if isinstance(subject, ast.Attribute) and subject.attr == "kind":
                cases = [x for case in node.cases for x in ast.walk(case.pattern)]
                yield node.lineno, {x.value for x in cases if isinstance(x, ast.Constant)}


def test_nobody_asks_which_kind_a_shape_is():
    """The file of a kind answers what depends on it."""
    found = [
        f"{name}:{line}"
        for name, tree in sources(KINDS)
        for line, constants in compared(tree) if constants & set(KINDS)
    ]  # fmt: skip
    assert found == []
