"""Mass properties of shapes and of mesh files."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_core import shapes as solids
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model.shape import mass_properties
from pgraph_core.show import shapes as show_shapes

from .convex import signed_distance

TURN = (0.5, 0.5, -0.5, 0.5)
FINE = 2e-3  # of a round shape's mesh with many facets

SHAPES = [  # with half of the size
    ({"kind": "box", "size": (1, 2, 3)}, trimesh.creation.box((1, 2, 3)), 1e-12, (0.5, 1, 1.5)),
    ({"kind": "sphere", "radius": 0.7}, trimesh.creation.icosphere(5, 0.7), FINE, (0.7, 0.7, 0.7)),
    ({"kind": "cylinder", "radius": 0.5, "length": 2},
     trimesh.creation.cylinder(0.5, 2, sections=300), FINE, (0.5, 0.5, 1)),
    ({"kind": "capsule", "radius": 0.5, "length": 2},
     trimesh.creation.capsule(2, 0.5, count=(200, 200)), FINE, (0.5, 0.5, 1.5)),
    *((fields, None, 0.03, None) for fields in (  # polygons of few facets
        {"kind": "capsule", "radius": 0.05, "end_radius": 0.03, "length": 0.2, "role": "visual"},
        {"kind": "capsule", "radius": 0.02, "end_radius": 0.06, "length": 0.1, "role": "visual"},
        {"kind": "cylinder", "radius": 0.05, "end_radius": 0.01, "length": 0.2, "role": "visual"},
    )),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "mesh", "tolerance", "half"), SHAPES)
def test_closed_forms_equal_the_integral_over_a_mesh(fields, mesh, tolerance, half):
    """A tapered solid is compared with the surface that is drawn."""
    shape = pg.Shape(**fields, position=(0.1, 0.2, 0.3), rotation=TURN)
    found = mass_properties(shape, 1000.0)
    if half:
        box, middle = solids.kind_of(shape).solids(shape)[0].box
        np.testing.assert_allclose(box, half)
        np.testing.assert_allclose(middle, 0)
        mesh.apply_transform(trimesh.transformations.quaternion_matrix(TURN))
        mesh.apply_translation(shape.position)
    else:
        mesh = show_shapes.mesh(show_shapes.pieces(pg.Body(name="a", shape=shape), ()))
    mesh.density = 1000.0
    assert mesh.is_watertight
    assert found.mass == pytest.approx(mesh.mass, rel=tolerance)
    size = fields.get("length", 1)
    np.testing.assert_allclose(found.com, mesh.center_mass, atol=max(0.1 * tolerance * size, 1e-12))
    inertia = mesh.moment_inertia
    np.testing.assert_allclose(found.inertia, inertia, rtol=0, atol=2 * tolerance * inertia.max())


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_mesh_file_has_the_mass_of_its_solid(tmp_path, inside_out):
    """In millimetres, off its origin, and wound either way."""
    mesh = trimesh.creation.box((100, 200, 300))
    mesh.apply_translation((50, 0, 0))
    if inside_out:
        mesh.invert()
    mesh.export(tmp_path / "brick.stl")
    shape = pg.Shape(kind="mesh", file=str(tmp_path / "brick.stl"))
    found = mass_properties(shape, 1000.0, unit="mm")
    box = mass_properties(pg.Shape(kind="box", size=(0.1, 0.2, 0.3)), 1000.0)
    assert found.mass == pytest.approx(6.0)
    np.testing.assert_allclose(found.com, (0.05, 0, 0), atol=1e-9)
    np.testing.assert_allclose(found.inertia, box.inertia, atol=1e-9)


def test_the_hull_of_a_mesh_file_is_a_solid(tmp_path):
    """Coplanar facets are one face, and hollows are filled."""
    box, hole = trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(radius=0.2)
    trimesh.util.concatenate((box, hole)).export(tmp_path / "part.obj")
    solid = solids.convex_hull(tmp_path / "part.obj", scale=2)
    assert solid.vertices.shape == (8, 3)
    assert sorted(map(len, solid.rings)) == [4] * 6
    assert len(solids.edges_of(solid)) == 12
    np.testing.assert_allclose(solid.vertices.max(axis=0), (1, 2, 3))


def grid(seed):
    """Single precision, as in STL files: points of one plane or line are off it by 1e-7."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(-1, 2, (40, 3)) * rng.choice([1.0, 0.5], (40, 1))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return (corners @ turn).astype(np.float32).astype(float)


def plate(seed):
    """Two discs: between corners in one plane there are facets whose normals are anything."""
    rng = np.random.default_rng(seed)
    angle, far = rng.uniform(0, 2 * np.pi, 100), np.sqrt(rng.uniform(0, 1, 100))
    disc = np.column_stack((0.1 * far * np.cos(angle), 0.07 * far * np.sin(angle)))
    places = np.array([(x, y, z) for x, y in disc for z in (-0.01, 0.01)])
    return Rotation.random(random_state=seed).apply(places).astype(np.float32)


def cloud(count):
    return np.random.default_rng(count).normal(size=(count, 3)) + 5


@pytest.mark.parametrize(
    ("points", "tolerance", "slack"),
    [*((grid(seed), 1e-6, 1e-7) for seed in range(8)),
     *((plate(seed), 1e-6, 1e-9) for seed in range(5)),
     *((cloud(count), 1e-12, 1e-9) for count in (4, 5, 30, 200))],
)  # fmt: skip
def test_hulls_are_closed_and_convex(points, tolerance, slack):
    """A vertex on an edge of one face belongs to that face too, or to no edge of either."""
    solid = solids.hull(points)
    edges, normals = solids.edges_of(solid), solid.normals
    assert len(solid.vertices) - len(edges) + len(solid.rings) == 2  # Euler
    for ring, normal in zip(solid.rings, normals):
        corners = solid.vertices[list(ring)]
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert ((points - corners[0]) @ normal).max() < tolerance
        for start, end in zip(corners, np.roll(corners, -1, axis=0)):
            inside = (corners - start) @ np.cross(normal, end - start)
            assert inside.min() > -slack * np.linalg.norm(end - start)
    for u, v, f, g in edges:
        along = np.cross(normals[g], normals[f]) @ (solid.vertices[v] - solid.vertices[u])
        assert along > (0.0 if tolerance < 1e-9 else -tolerance)
    assert all(signed_distance(p[None], solid.vertices) < max(tolerance, 1e-10) for p in points)


def test_a_hull_is_computed_once_for_its_points():
    """A copy of the points has the same hull, and its tables; points that differ have their own."""
    points = cloud(100)
    solid = solids.hull(points)
    assert solids.hull(points.copy()) is solid
    assert solid.normals is solid.normals
    assert solids.edges_of(solid) is solids.edges_of(solid)
    moved = points + np.array((0.0, 0.0, 1e-9))
    assert np.ptp(solids.hull(moved).vertices - solid.vertices, axis=0).max() < 1e-14
    assert solids.hull(moved) is not solid


def open_box(folder: Path) -> Path:
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(np.arange(12) != 3)
    box.export(folder / "open.stl")
    return folder / "open.stl"


def test_meshes_that_cannot_be_used_are_refused(tmp_path):
    file = open_box(tmp_path)
    shape = pg.Shape(kind="mesh", file=str(file))
    (tmp_path / "cut.glb").write_bytes(b"glTF damaged")
    (tmp_path / "part.xyz9").write_bytes(b"")
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    for call, fact in (
        (lambda: mass_properties(shape, 1000), f"{re.escape(str(file))}.* 3 "),
        (lambda: mass_properties(shape, 0), "> 0"),
        (lambda: load_mesh(file, unit="inch"), "m, cm, mm, in, ft.*'inch'"),
        (lambda: load_mesh(tmp_path / "none.stl"), "none.stl"),
        (lambda: load_mesh(tmp_path / "cut.glb"), "cut.glb"),
        (lambda: load_mesh(tmp_path / "part.xyz9"), r"\.xyz9.* glb"),
        (lambda: solids.convex_hull(flat), "flat"),
    ):
        with pytest.raises(pg.PgraphError, match=fact):
            call()


def test_an_open_mesh_touches_by_its_hull_on_request(tmp_path):
    """Its convex hull is that of the box. Without a request the contact is refused."""
    file = open_box(tmp_path)
    rests = np.zeros(6)
    for hull in (None, "convex"):
        shape = pg.Shape(kind="mesh", file=str(file), hull=hull)
        body = pg.Body(
            name="part", joint="free", q=(0, 0, 0.5, 1, 0, 0, 0), shape=shape, inertia=(0.01,) * 3
        )  # fmt: skip
        model = pg.Model(bodies=(body,), contacts=(pg.Contact(name="floor", body="part"),))
        mech = pg.Mechanism(model)
        if hull is None:
            with pytest.raises(pg.ModelError, match=r"contact 'floor'.*'part'.*'convex'"):
                pg.simulate(mech, t_end=0.01)
        else:
            rests = pg.simulate(mech, t_end=0.1).contact_force["floor"][-1]
    assert rests[5] == pytest.approx(9.81, rel=1e-6)


COLLADA = """<?xml version="1.0"?>
<COLLADA><asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="15">0 0 0 1 0 0 1 1 0 0 1 0 0.5 0.5 1</float_array>
<technique_common><accessor source="#a" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>4</vcount><p>3 2 1 0</p></polylist>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="1"/>
<input semantic="NORMAL" source="#n" offset="0"/>
<p>9 0 9 1 9 4 9 1 9 2 9 4 9 2 9 3 9 4 9 3 9 0 9 4</p></triangles>
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s">
<node><translate>0 0 100</translate><scale>2 1 1</scale><node><rotate>0 0 1 90</rotate>
<instance_geometry url="#g"/></node></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
NODE = '<instance_node url="#n"/><node id="n"><instance_node url="#n"/><rotate>'

TEN = "".join(
    f'<node id="n{k}">' + 10 * f'<instance_node url="#n{k + 1}"/>' + "</node>" for k in range(9)
)


def test_collada_has_the_scene_in_metres(tmp_path, monkeypatch):
    monkeypatch.setattr("pgraph_core.mesh_files.MOST_NODES", 2000)
    (tmp_path / "pyramid.dae").write_text(COLLADA)
    mesh = load_mesh(tmp_path / "pyramid.dae")
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.volume, 2 / 3 * 1e-6, rtol=1e-12)
    np.testing.assert_allclose(mesh.bounds, [[-0.02, 0, 1], [0, 0.01, 1.01]], atol=1e-15)
    mirrored = load_mesh(tmp_path / "pyramid.dae", scale=(1, -1, 1))
    np.testing.assert_allclose(mirrored.volume, mesh.volume)  # still turned outside
    for old, new, text in (
        ("3 2 1 0", "3 2 1 7", "vertices"),
        ("<vcount>4", "<vcount>9", "corners"),
        ("0 0 100", "0 0", " 3 "),
        ("<node><rotate>", NODE, "line 13.*cycle"),
        ("<node><rotate>", f"{TEN}<node><rotate>", "line 13.*more than 2000 nodes"),
        ("<COLLADA>", "<!DOCTYPE a><COLLADA>", "document type"),
    ):  # fmt: skip
        (tmp_path / "bad.dae").write_text(COLLADA.replace(old, new, 1))
        with pytest.raises(pg.FileError, match=text):
            load_mesh(tmp_path / "bad.dae")


@pytest.mark.parametrize("given", [
    {"kind": "box", "size": (1, 1, 1), "role": "visual"}, {"kind": "capsule", "role": "both"},
    {"kind": "capsule", "role": "visual", "end_radius": 0.5},
])  # fmt: skip
def test_a_taper_that_cannot_be_is_refused_with_its_number(given):
    with pytest.raises(pg.ModelError, match=r"0\.(05|48)"):
        pg.Shape(**{"radius": 0.02, "length": 0.2, "end_radius": 0.05, **given})
