"""Pictures and films: the mechanism where it is, with its colours, at the requested size."""

import struct
import zlib

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.show.pictures import Drawing
from pgraph_core.show.raster import NO_FACE, cover

RED = pg.Shape(kind="sphere", radius=0.1, colour=(0.9, 0.05, 0.05))


def ball(at, kind: pg.Shape = RED) -> pg.Model:
    body = pg.Body(name="ball", mass=1.0, link=at, axes=(0, 1, 0), shapes=[kind])
    return pg.Model(bodies=[body])


def pixels(path) -> np.ndarray:
    """(height, width, 3) of a PNG without filters, read by its chunks."""
    data, found = path.read_bytes()[8:], {}
    while data:
        size, kind = struct.unpack(">I4s", data[:8])
        assert struct.unpack(">I", data[8 + size : 12 + size])[0] == zlib.crc32(data[4 : 8 + size])
        found[kind], data = data[8 : 8 + size], data[12 + size :]
    width, height = struct.unpack(">II", found[b"IHDR"][:8])
    rows = np.frombuffer(zlib.decompress(found[b"IDAT"]), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, 3)


def red(picture: np.ndarray) -> np.ndarray:
    r, g, b = np.moveaxis(picture.astype(int), -1, 0)
    return (r > 60) & (r > 2 * g) & (r > 2 * b)


def drawing_of(model: pg.Model, size=(320, 200), **look) -> tuple[Drawing, np.ndarray]:
    mech = pg.Mechanism(model)
    place, _ = mech.poses(mech.home()[0])
    pose = np.column_stack((place, np.tile((1.0, 0, 0, 0), (len(place), 1))))
    return Drawing(model, pose[None], size, **look), pose


def test_a_triangle_covers_the_pixels_whose_centres_it_holds():
    points = np.array([[0.0, 0, 1], [8, 0, 1], [0, 8, 1], [0, 0, 2], [4, 0, 2], [0, 4, 2]])
    depth, seen = np.zeros((8, 8)), np.full((8, 8), NO_FACE, np.int32)
    cover(points, np.array([[0, 1, 2], [3, 4, 5]], np.int32), np.ones(2), depth, seen)
    y, x = np.mgrid[:8, :8] + 0.5
    near, far = x + y <= 4, x + y <= 8
    assert np.array_equal(seen == 1, near)  # the nearer one hides the other
    assert np.array_equal(seen == 0, far & ~near)


@pytest.mark.parametrize("opacity", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_a_transparent_triangle_covers_its_share_of_the_pixels(opacity):
    points = np.array([[0.0, 0, 1], [128, 0, 1], [0, 128, 1]])
    depth, seen = np.zeros((64, 64)), np.full((64, 64), NO_FACE, np.int32)
    cover(points, np.array([[0, 1, 2]], np.int32), np.array([opacity]), depth, seen)
    assert (seen == 0).mean() == pytest.approx(opacity, abs=1 / 32)


@pytest.mark.parametrize("opacity", [0.0, 0.3, 1.0])
def test_a_picture_shows_what_is_behind_a_transparent_body(opacity):
    """The shares of pixels in which a sheet and the block behind it are seen sum to one."""
    block = {"kind": "box", "size": (0.9, 0.9, 0.2), "colour": "#0000ff"}
    sheet = {"kind": "box", "size": (1, 1, 0.01), "position": (0, 0, 0.5), "colour": "#ff0000"}
    model = pg.Model.serial(1).edit("1", shapes=[block, {**sheet, "opacity": opacity}])
    drawing, pose = drawing_of(model, view="top")
    drawing.draw(pose)
    near = drawing._seen[160:240, 280:360]
    front = np.isin(near, np.flatnonzero(drawing._colors[:, 0] > 0.5))
    assert (near != NO_FACE).all()
    assert front.mean() == pytest.approx(opacity, abs=1 / 32)


@pytest.mark.parametrize("view", ["start", "front", "side", "top", "isometric"])
def test_a_ball_is_where_the_camera_projects_its_centre_and_as_large(view):
    """Its outline is an ellipse about its middle but for perspective: sin of the half angle."""
    drawing, pose = drawing_of(ball((0.3, 0.2, 1.0)), view=view)
    seen = red(drawing.draw(pose))
    x, y, deep = drawing.on_screen(pose[:, :3], pose)[0]
    rows, columns = np.nonzero(seen)
    assert abs(columns.mean() + 0.5 - x) < 1.5
    assert abs(rows.mean() + 0.5 - y) < 1.5
    pixel = 2 * float(np.linalg.norm(drawing.camera(pose).right))
    angle = np.arcsin(0.1 * deep)
    expected = np.pi * (np.tan(angle) / pixel) ** 2
    assert seen.sum() == pytest.approx(expected, rel=0.06)  # the facets of the ball, its rim


def test_the_ball_throws_a_shadow_where_the_sun_is_behind_it():
    model = ball((0, 0, 0.3))
    drawing, pose = drawing_of(model, (320, 240), view="top")
    picture = drawing.draw(pose).astype(float).mean(axis=-1)
    ground, sun = drawing.ground, drawing.towards_sun
    normal = np.array(ground.normal)
    high = (pose[0, :3] - np.array(ground.point)) @ normal
    under = pose[0, :3] - high / (sun @ normal) * sun
    x, y, _ = drawing.on_screen(under[None], pose)[0]
    beside, y_beside, _ = drawing.on_screen((under + 0.35 * np.cross(sun, normal))[None], pose)[0]
    assert picture[int(y), int(x)] < 0.85 * picture[int(y_beside), int(beside)]


def test_a_picture_has_its_size_and_is_the_same_every_time(tmp_path):
    model, path = ball((0, 0, 1.0)), tmp_path / "a.png"
    model.to_image(path, size=(200, 120))
    first = path.read_bytes()
    assert pixels(path).shape == (120, 200, 3)
    light = pixels(path)
    assert red(light).any()
    model.to_image(path, size=(200, 120))
    assert path.read_bytes() == first
    model.to_image(path, size=(200, 120), dark=True)
    assert pixels(path).mean() < 0.5 * light.mean()


def test_the_digraph_as_svg(tmp_path):
    model = pg.Model.serial(3)
    model.to_image(tmp_path / "d.svg", what="digraph", size=(300, 200))
    text = (tmp_path / "d.svg").read_text()
    assert all(f"<title>{body.name}</title>" in text for body in model.bodies)
    assert 'width="300" height="200"' in text


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_a_film_has_its_frames_and_shows_the_motion(kind, tmp_path):
    av = pytest.importorskip("av")
    falling = pg.Body(name="ball", mass=1.0, joint="free", shapes=[RED], link=(0, 0, 2.0))
    run = pg.simulate(pg.Model(bodies=[falling]), t_end=0.5, step=0.01, method="rk4")
    path = tmp_path / f"run.{kind}"
    run.to_film(path, size=(128, 96), fps=20, view="side")
    with av.open(str(path)) as file:
        frames = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
    assert len(frames) == 11
    assert frames[0].shape == (96, 128, 3)
    rows = [np.nonzero(red(frame))[0].mean() for frame in frames]
    assert (np.diff(rows) > 0).all()  # it falls
    fallen = np.array(rows) - rows[0]
    assert fallen[-1] / fallen[5] == pytest.approx(4.0, rel=0.25)  # by g t^2 / 2


@pytest.mark.parametrize(
    ("call", "given", "fact"),
    [
        ("to_image", {"path": "a.jpg"}, r"\.png"), ("to_film", {"path": "a.avi"}, r"\.mp4"),
        ("to_image", {"size": (0, 10)}, r"\(0, 10\)"), ("to_image", {"size": 100}, "100"),
        ("to_image", {"size": (float("inf"), 100)}, "inf"),
        ("to_image", {"view": "back"}, "'back'"), ("to_image", {"t": 2.0}, r"0 to 0\.1 s"),
        ("to_film", {"fps": 0}, "fps"),
        ("to_film", {"path": "a.gif", "fps": 240, "speed": 1e-6}, "speed"),
        *(("to_film", {"path": path, "size": (8192, 8192), "fps": 200, "speed": 0.01}, "pixels")
          for path in ("a.gif", "a.mp4")),
    ],
)  # fmt: skip
def test_pictures_that_cannot_be_are_refused(call, given, fact, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {"path": "a.png" if call == "to_image" else "a.mp4", **given}
    with pytest.raises(pg.PgraphError, match=fact):
        getattr(pg.simulate(pg.Model.serial(1), t_end=0.1), call)(given.pop("path"), **given)
    assert not any(tmp_path.iterdir())
