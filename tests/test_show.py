"""Pictures and tables for notebooks and files: they hold the model's and the run's numbers."""

import base64
import gzip
import json
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core import show
from pgraph_core.show import bodies, notebook, shapes, stage
from pgraph_core.show.stage import GRID, fitted, in_picture, towards

pytestmark = pytest.mark.quick


@pytest.fixture(scope="module")
def run() -> pg.Result:
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("double_pendulum")))
    return pg.simulate(mech, t_end=0.2)


def test_a_digraph_shows_every_body_once_and_every_loop():
    svg = show.digraph_svg(["crank", "rod <1>", "rocker"], [0, 1, 0], [(2, 3)])
    tree = ElementTree.fromstring(svg)
    texts = ["".join(node.itertext()) for node in tree.iter("{http://www.w3.org/2000/svg}text")]
    assert texts == ["1", "crank", "2", "rod <1>", "3", "rocker"]
    dashed = [node for node in tree if node.get("stroke-dasharray")]
    assert len(dashed) == 1
    colours = {*re.findall(r'(?:stroke|fill)="([^"]+)"', svg)}
    assert colours == {"currentColor", "none", "#d9730d"}  # legible on light and on dark


def test_tables_of_a_model_a_mechanism_and_a_run_hold_their_numbers(run):
    quadruped = pg.Model.load(pgraph_models.path("quadruped"))
    bodies, parent = notebook.numbered(quadruped)
    topology = pg.Topology.of(quadruped)
    assert [body.name for body in bodies] == list(topology.names)
    assert parent == topology.parent.tolist()
    html = show.model_html(quadruped)
    rows = re.findall(r"<tr><td>(.*?)</td></tr>", html)
    assert len(rows) == len(quadruped.bodies)
    for body, row in zip(bodies, rows):
        _, name, parent, joint, dof, mass = row.split("</td><td>")
        assert (name, parent, joint, int(dof)) == (body.name, body.parent, body.joint, body.dof)
        assert float(mass) == pytest.approx(body.mass, rel=1e-5)
    assert "<svg" in html
    html = show.mechanism_html(pg.Mechanism(quadruped))
    (row,) = re.findall(r"<tr><td>Pgraph</td><td>(.*?)</td></tr>", html)
    assert [int(x) for x in row.split("</td><td>")] == topology.pgraph.tolist()
    html = show.run_html(run)
    for text in (run.message, f"{run.error_estimate:.2g}", run.header["method"]):
        assert text in html


def test_a_figure_has_a_panel_for_each_unit_and_the_columns_numbers(run: pg.Result):
    pytest.importorskip("matplotlib").use("Agg")
    drawn = run.plot("upper", "lower", "kinetic energy")
    assert [axis.get_ylabel() for axis in drawn.axes] == ["[rad]", "[J]"]
    upper, lower = drawn.axes[0].lines
    np.testing.assert_array_equal(upper.get_ydata(), run["upper"])
    np.testing.assert_array_equal(lower.get_ydata(), run["lower"])
    (axis,) = run.plot().axes
    assert [line.get_label() for line in axis.lines] == ["upper", "lower"]
    with pytest.raises(pg.InputError, match=r"'uper'.*upper"):
        run.plot("uper")


@pytest.mark.parametrize(
    ("package", "remedy", "call"),
    [
        (
            "pandas",
            "pip install 'pgraph-dynamics[pandas]'",
            "from pgraph_core.result import columns; columns.frame({})",
        ),
        (
            "matplotlib",
            "pip install 'pgraph-dynamics[plot]'",
            "show.figure([0], {'a': ('rad', [0])})",
        ),
        ("trimesh", "without PGRAPH_LEAN", "show.shapes.unit('box')"),
        ("trimesh", "without PGRAPH_LEAN", "show.shapes.unit('mesh', 'a.stl')"),
    ],
)
def test_a_missing_package_is_named_with_what_installs_it(package, remedy, call):
    code = (
        f"import sys; sys.modules['{package}'] = None\n"
        "from pgraph_core import show\n"
        "heavy = {'viser', 'trimesh', 'matplotlib', 'pandas', 'numba'} & set(sys.modules)\n"
        f"print(heavy - {{{package!r}}})\n"
        f"try: {call}\n"
        "except (show.MissingPackage, ImportError) as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("set()\n")
    assert f"'{package}'" in done.stdout
    assert remedy in done.stdout


@pytest.mark.parametrize("leaves", [False, True])
def test_the_camera_sees_the_whole_motion(leaves: bool):
    box = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    thrown = pg.Body(name="a", joint="free", v=(0, 3, 0, 4, 0, 2), link=(0, 0, 1), shape=box)
    swings = pg.Body(
        name="a", axes=(0, 1, 0), q=(1.5,), link=(0, 0, 2), com=(0, 0, -0.5), tip=(0, 0, -1)
    )
    run = pg.simulate(pg.Model(bodies=(thrown if leaves else swings,)), t_end=1.3)
    up = np.array((0.0, 0.0, 1.0))
    found = bodies.looks(run.mechanism.model.bodies, ((1,), ()), [(1, 2, 3)])
    track = bodies.Track(found, run.body_pose, up)
    at = fitted(track.corners, up, towards("z", "start"), 1.2)
    assert in_picture(track.corners, up, at, 1.2).all()
    assert track.travels == leaves
    assert (np.ptp(track.corners[:, 0]) > 1.5) != leaves


def test_a_figure_is_one_page_with_bodies_where_the_run_has_them(run: pg.Result):
    page = run.to_html()
    assert page.lstrip().lower().startswith("<!doctype html")
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="https?://', page)
    (text,) = re.findall(r'<script[^>]*id="figure"[^>]*>(.*?)</script>', page, re.DOTALL)
    given = json.loads(text)
    assert given["engine"]["methods"] == []  # it plays alone
    kept = given["recording"]
    data, count = gzip.decompress(base64.b64decode(kept["data"])), kept["count"]
    before = 8 * count * (1 + kept["nq"] + kept["nv"])
    places = np.frombuffer(data, np.float32, count * 2 * 3, before).reshape(count, 2, 3)
    for k in (0, -1):
        np.testing.assert_allclose(places[k], run.body_pose[k, :, :3], atol=1e-6)
    t = np.frombuffer(data, np.float64, count)
    assert (t[0], t[-1]) == (run.t[0], run.t[-1])


def test_the_camera_is_as_near_as_it_can_be_and_sees_every_point():
    rng = np.random.default_rng(4)
    for _ in range(50):
        points = rng.normal(size=(30, 3)) * rng.uniform(0.01, 20, 3) + rng.normal(size=3)
        up, which = rng.choice(["x", "y", "z"]), rng.choice(["front", "side", "top", "isometric"])
        axis, aspect = np.array(GRID[up][1]), rng.uniform(0.4, 2.5)
        way = stage.towards(up, which)
        free = stage.Free(*rng.choice([1.0, 0.7], 4).tolist())
        at = stage.fitted(points, axis, way, aspect, free)
        np.testing.assert_allclose(np.cross(at.position - at.target, way), 0, atol=1e-9)
        assert stage.in_picture(points, axis, at, aspect).all()
        right, above = stage.frame(axis, way)
        deep = (at.position - points) @ way
        half = math.tan(stage.FRAMING.field_of_view / 2)
        x = (points - at.position) @ right / (deep * half * aspect)
        y = (points - at.position) @ above / (deep * half)
        edges = np.minimum(stage.FRAMING.margin, free)  # what covers the picture covers no point
        shares = np.array([-x.min(), x.max(), -y.min(), y.max()]) / edges
        assert (shares < 1 + 1e-9).all()
        fills = max(shares[:2].min(), shares[2:].min())  # it touches two opposite edges
        assert fills == pytest.approx(1, abs=1e-9) or np.linalg.norm(at.position - at.target) < 0.03


def test_the_floor_is_below_hanging_bodies_and_at_the_plane_of_contacts():
    hanging = pg.Model.serial(4)
    top = pg.Topology.of(hanging)
    positions, _ = pg.home_poses(hanging)
    low = stage.depth(hanging, hanging.bodies, top.parent.tolist(), positions, 0.4)
    assert low == pytest.approx(sum(np.linalg.norm(b.tip_point) for b in hanging.bodies), abs=0.2)
    touching = hanging.add(pg.Contact(name="c", body="4", points=((0, 0, 0),)))
    assert stage.depth(touching, hanging.bodies, top.parent.tolist(), positions, 0.4) == 0


def test_the_box_of_a_mesh_is_that_of_its_file_in_its_scales(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.2, 0.4, 0.6)).export(tmp_path / "box.stl")
    shape = pg.Shape(kind="mesh", file=str(tmp_path / "box.stl"), scale=(1, 2, 0.5))
    (piece,) = shapes.pieces(pg.Body(name="a", shape=shape), ())
    corners = bodies.corners([piece])
    np.testing.assert_allclose(np.ptp(corners, axis=0), (0.2, 0.8, 0.3))
    np.testing.assert_allclose(shapes.mesh([piece]).extents, (0.2, 0.8, 0.3))


@pytest.mark.parametrize(("name", "normal"), [("four_bar", (0, 0, 1)), ("double_pendulum", None)])
def test_a_plane_of_motion_is_seen_close_to_its_normal(name, normal):
    model = pg.Model.load(pgraph_models.path(name))
    mech = pg.Mechanism(model)
    rotations = np.array([mech.pose(mech.home()[0], body.name)[1] for body in model.bodies])
    way = stage.start(model.up, model.bodies, rotations)
    axis = np.asarray(normal or rotations[0] @ model.bodies[0].sequence[0].axis)
    assert abs(axis @ way) == pytest.approx(np.cos(np.arctan(stage.FRAMING.tilt)))


def test_bodies_that_leave_a_plane_are_seen_from_the_usual_side():
    model = pg.Model(bodies=[pg.Body(name="a", axes=[(1, 0, 0)]), pg.Body(name="b", parent="a")])
    model = model.edit("b", axes=[(0, 1, 0)])
    way = stage.start("z", model.bodies, np.array([np.eye(3)] * 2))
    np.testing.assert_array_equal(way, stage.towards("z", "start"))


def test_another_run_is_drawn_beside_one_and_is_in_view(tmp_path):
    from pgraph_core.show import pictures

    arm = pg.Model.serial(2)
    far = pg.simulate(arm.edit("1", link=(0, 0, 9)), t_end=0.1)
    run, size = pg.simulate(arm, t_end=0.1), (96, 64)
    ghost, pose = pictures.Ghost(far, 0.05), run.body_pose[0]
    for also in (ghost.corners, pictures.NO_POINTS):
        drawing = pictures.Drawing(arm, pose[None], size, also=also)
        x, y, _ = drawing.on_screen(ghost.corners, pose).T
        inside = (x >= 0) & (x <= size[0]) & (y >= 0) & (y <= size[1])
        assert inside.all() == bool(len(also))
    plain, both = (pictures.moment(run, "a.png", other=x, size=size) for x in (None, far))
    assert plain != both
    run.to_film(tmp_path / "a.gif", size=size, fps=10, beside=far)
    with pytest.raises(pg.InputError, match=r"beside.*must be a run, got 3"):
        run.to_image(tmp_path / "a.png", beside=3)
