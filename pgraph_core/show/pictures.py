"""Pictures as PNG and SVG, and videos as MP4 and GIF, as the bytes of a file named `path`.

PNG needs no package. GIF needs Pillow, MP4 needs PyAV, plots Matplotlib.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError, InputError, Problem, choices, needed, shown
from ..numbering import children_of
from . import shapes, stage
from .bodies import Track, looks
from .digraph import digraph_svg
from .notebook import between, digraph_of, numbered
from .raster import NO_FACE, Camera, Ground, Sun, Tones, cover, developed, light

DPI = 100  # resolution of plots, whose size is in pixels
LONGEST_FILM = 20_000  # limit on the frames of a film
MOST_OF_A_GIF = 1_000_000_000  # limit on the pixels of all its frames, one byte each
GIF_RATES = (50, 33, 25, 20, 10, 5, 2, 1)  # frames a second that viewers of GIF keep
QUALITY = "20"  # constant rate factor of x264: 18 looks like the original, 28 is coarse
Progress = Callable[[float], Any] | None


class Beside(NamedTuple):
    """Faces that are drawn beside the bodies, in world axes."""

    places: np.ndarray  # (3 m, 3) corners [m]
    normals: np.ndarray  # (3 m, 3)
    colors: np.ndarray  # (m, 3) linear light
    opacity: np.ndarray  # (m,)

    @classmethod
    def of(cls, solids: Sequence[tuple[Any, Any, Sequence[int], float]] = ()) -> Beside:
        """Return solids as faces: each has corners and normals (m, 3, 3), sRGB and opacity."""
        three, one = np.zeros((0, 3)), np.zeros(0)
        return cls(
            np.concatenate([three, *(corners.reshape(-1, 3) for corners, *_ in solids)]),
            np.concatenate([three, *(normals.reshape(-1, 3) for _, normals, *_ in solids)]),
            np.concatenate(
                [three, *(np.tile(linear(color), (len(x), 1)) for x, _, color, _ in solids)]
            ),
            np.concatenate([one, *(np.full(len(x), opacity) for x, _, _, opacity in solids)]),
        )


Extra = Callable[[float, np.ndarray], Beside] | None  # function of a time [s] and the poses (nb, 7)


GHOST = (120, 128, 140), 0.45  # colour and opacity of the bodies of another run
NO_POINTS = np.zeros((0, 3))


class Ghost:
    """The bodies of another run in grey, at the same time. They rest before its start and after its
    end.
    """

    def __init__(self, run: Any, at: float | None = None):
        """Keep the whole run, or its pose at one time [s]. Raises InputError."""
        if not hasattr(run, "body_pose"):
            raise InputError(Problem("picture", "beside", f"must be a run, got {shown(run)}"))
        self._times, self._poses = np.asarray(run.t), np.asarray(run.body_pose)
        poses = self._poses if at is None else self._pose(at)[None]
        self._drawing = Drawing(run.mechanism.model, poses, (LEAST_PIXELS, LEAST_PIXELS))
        self.corners = self._drawing.track.corners  # (m, 3) points that are seen [m]

    def __call__(self, time: float, _: np.ndarray) -> Beside:
        return self._drawing.faces(self._pose(time), *GHOST)

    def _pose(self, time: float) -> np.ndarray:
        held = float(np.clip(time, self._times[0], self._times[-1]))
        return np.column_stack(between(self._times, self._poses, held))


# -- pictures --------------------------------------------------------------------------------------


def view(
    model: Any, pose: np.ndarray, path: str | Path, *,
    size: tuple[int, int] = (1280, 720), view: Any = "start", dark: bool = False,
    beside: Beside | None = None, also: np.ndarray = NO_POINTS,
) -> bytes:  # fmt: skip
    """Return a picture of a model with bodies at `pose` (nb, 7), ordered by number.

    The points `also` (m, 3) are in view too. Raises InputError, FileError.
    """
    _suffix(path, (".png",), "picture")
    drawing = Drawing(model, pose[None], size, view=view, dark=dark, also=also)
    return png(drawing.draw(pose, beside))


def digraph(model: Any, path: str | Path, *, size: tuple[int, int] | None = None) -> str:
    """Return a picture of a model's digraph with `size` in pixels, by default its natural size.

    Raises InputError, FileError.
    """
    _suffix(path, (".svg",), "picture of the digraph")
    return digraph_svg(*digraph_of(model), size=None if size is None else checked_size(size))


def plot(
    run: Any, path: str | Path, names: Sequence[str] = (), *, size: tuple[int, int] = (900, 600)
) -> bytes:
    """Plot columns of a run over time. Raises InputError, FileError, MissingPackage."""
    suffix = _suffix(path, (".png", ".svg"), "picture")
    width, height = checked_size(size)
    drawn = run.plot(*names)
    drawn.set_size_inches(width / DPI, height / DPI)
    content = io.BytesIO()
    drawn.savefig(content, format=suffix[1:], dpi=DPI)
    return content.getvalue()


def moment(
    run: Any, path: str | Path, t: float | None = None, extra: Extra = None, other: Any = None,
    **look: Any,
) -> bytes:  # fmt: skip
    """Return a picture of a run at time t [s], by default at its start, with another one in grey.

    Raises InputError.
    """
    times, poses = np.asarray(run.t), np.asarray(run.body_pose)
    t = float(times[0]) if t is None else t
    if not (isinstance(t, (int, float, np.integer, np.floating)) and times[0] <= t <= times[-1]):
        text = f"must be a time of the run, {times[0]:g} to {times[-1]:g} s, got {t!r}"
        raise InputError(Problem("to_image", "t", text))
    pose = np.column_stack(between(times, poses, t))
    ghost = None if other is None else Ghost(other, t)
    extra, also = (extra, NO_POINTS) if ghost is None else (ghost, ghost.corners)
    beside = None if extra is None else extra(t, pose)
    return view(run.mechanism.model, pose, path, beside=beside, also=also, **look)


def png(pixels: np.ndarray) -> bytes:
    """Encode (height, width, 3) bytes as a PNG file (ISO/IEC 15948)."""
    height, width, _ = pixels.shape
    rows = np.concatenate((np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)), axis=1)
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows.tobytes(), 6)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )


# -- films -----------------------------------------------------------------------------------------


def film(
    run: Any, path: str | Path, *, size: tuple[int, int] = (960, 540), fps: float = 30,
    speed: float = 1.0, view: Any = "start", dark: bool = False, progress: Progress = None,
    extra: Extra = None, other: Any = None,
) -> bytes | None:  # fmt: skip
    """Return a video of a run, or None if `progress(fraction)` returns False after a frame.

    `speed=0.5` plays at half speed. The `other` run is drawn in grey. Raises InputError, FileError,
    MissingPackage.
    """
    suffix = _suffix(path, (".mp4", ".gif"), "film")
    for name, value, most in (("fps", fps, 240), ("speed", speed, 1000)):
        if not (isinstance(value, (int, float, np.integer, np.floating)) and 0 < value <= most):
            text = f"must be a number > 0, {most} at most, got {value!r}"
            raise InputError(Problem("to_film", name, text))
    times, poses = np.asarray(run.t), np.asarray(run.body_pose)
    if suffix == ".gif":
        fps = min(GIF_RATES, key=lambda rate: abs(rate - fps))
    count = max(round((times[-1] - times[0]) / speed * fps) + 1, 1)
    if count > LONGEST_FILM:
        text = f"would have {count} frames, {LONGEST_FILM} at most: lower fps or raise speed"
        raise InputError(Problem("to_film", "fps", text))
    width, height = checked_size(size)
    if suffix == ".gif" and count * width * height > MOST_OF_A_GIF:
        text = f"would have {count} frames of {width} x {height} pixels, too much for a GIF"
        raise InputError(Problem("to_film", "size", f"{text}: give a smaller size, or .mp4"))
    made = (_Gif if suffix == ".gif" else _Mp4)((width, height), fps)
    ghost = None if other is None else Ghost(other)
    extra, also = (extra, NO_POINTS) if ghost is None else (ghost, ghost.corners)
    drawing = Drawing(run.mechanism.model, poses, size, view=view, dark=dark, also=also)
    for k in range(count):
        time = min(times[0] + k / fps * speed, times[-1])
        pose = np.column_stack(between(times, poses, float(time)))
        made.add(drawing.draw(pose, None if extra is None else extra(float(time), pose)))
        if progress is not None and progress((k + 1) / count) is False:
            return None
    return made.end()


class _Mp4:
    """A writer for H.264 in an MP4 file, which all browsers and players support."""

    def __init__(self, size: tuple[int, int], fps: float):
        self._av = needed("av", "film")
        if size[0] % 2 or size[1] % 2:
            text = f"of a film must be even numbers, got {size!r}"
            raise InputError(Problem("to_film", "size", text))
        self._content = io.BytesIO()
        self._file = self._av.open(self._content, "w", format="mp4")
        rate = Fraction(fps).limit_denominator(1000)
        options = {"crf": QUALITY, "preset": "medium", "threads": "1"}
        self._stream = self._file.add_stream("libx264", rate=rate, options=options)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"

    def add(self, pixels: np.ndarray) -> None:
        frame = self._av.VideoFrame.from_ndarray(pixels, format="rgb24")
        self._file.mux(self._stream.encode(frame))

    def end(self) -> bytes:
        self._file.mux(self._stream.encode())
        self._file.close()
        return self._content.getvalue()


class _Gif:
    """A writer for GIF frames with the first frame's 256 colours and no flickering dither."""

    def __init__(self, size: tuple[int, int], fps: float):
        self._images, self._fps, self._frames = needed("PIL.Image", "film"), fps, []
        self._palette: Any = None

    def add(self, pixels: np.ndarray) -> None:
        image = self._images.fromarray(pixels)
        if self._palette is None:
            self._palette = image.quantize(255, method=self._images.Quantize.MEDIANCUT)
        plain = self._images.Dither.NONE
        self._frames.append(image.quantize(palette=self._palette, dither=plain))

    def end(self) -> bytes:
        content = io.BytesIO()
        self._frames[0].save(
            content, format="GIF", save_all=True, append_images=self._frames[1:],
            duration=round(100 / self._fps) * 10, loop=0, optimize=False, disposal=1,
        )  # fmt: skip
        return content.getvalue()


# -- helpers ---------------------------------------------------------------------------------------


def _suffix(path: str | Path, known: Sequence[str], what: str) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        text = f"is not a supported {what}; use a name ending in {' or '.join(known)}"
        text += ", or run.to_html for a web page" if what == "film" else ""
        raise FileError(Problem(str(path), "", text))
    return suffix


# -- a mechanism rendered to pixels ----------------------------------------------------------------

OVERSAMPLING = 2  # pixels that are drawn for each that is shown, each way
SHADOWS = 1536  # pixels of the sun's screen, each way
TILT = (-0.45, 0.25, 1.0)  # direction of the sun: right, towards the viewer, up
MOST_PIXELS = 8192  # each way
MOST_IN_ALL = 4096 * 4096  # pixels of a picture: about 2 GB while it is drawn
LEAST_PIXELS = 16


class Drawing:
    """A mechanism that can be drawn in any pose."""

    def __init__(self, model: Any, poses: np.ndarray, size: tuple[int, int], *,
                 view: stage.Which = "start", dark: bool = False,
                 also: np.ndarray = NO_POINTS):  # fmt: skip
        """Keep all `poses` (n, nb, 7) in view in a picture of `size` (width, height) pixels, and
        the points `also` (m, 3).

        Raises InputError for invalid sizes and views.
        """
        self.size = checked_size(size)
        if view not in stage.TOWARDS[model.up]:
            text = f"choose one of {choices(stage.TOWARDS[model.up])}, got {view!r}"
            raise InputError(Problem("picture", "view", text))
        bodies, parent = numbered(model)
        self.up = np.array(stage.GRID[model.up][1])
        children, colors = children_of(parent), shapes.branch_colors(parent)
        self.looks = looks(bodies, children, colors)
        self._solids(self.looks)
        self.track = Track(self.looks, poses, self.up)
        self._reach = self.track.size
        turns = shapes.to_matrix(poses[0, :, 3:])
        way = (
            stage.start(model.up, bodies, turns)
            if view == "start"
            else stage.towards(model.up, view)
        )
        seen = np.concatenate((self.track.corners, also))
        self._view = stage.fitted(seen, self.up, way, self.size[0] / self.size[1])
        self._right, self._above = stage.frame(self.up, way)
        self._way = way
        flat = stage.towards(model.up, "start") * self.track.across
        flat /= np.linalg.norm(flat)
        sunwards = np.array((np.cross(self.up, flat), flat, self.up)).T @ np.array(TILT)
        self.towards_sun = sunwards / np.linalg.norm(sunwards)
        low = stage.depth(model, bodies, parent, poses[0, :, :3], self._reach)
        self.ground = self._plane(model, low)
        self._steps(model)
        self.tones = tones(stage.DARK if dark else stage.LIGHT, model.up)
        width, height = self.size[0] * OVERSAMPLING, self.size[1] * OVERSAMPLING
        self._picture = np.empty((height, width, 3), np.float32)
        self._depth, self._seen = np.empty((height, width)), np.empty((height, width), np.int32)
        self._shade = np.empty((SHADOWS, SHADOWS)), np.empty((SHADOWS, SHADOWS), np.int32)

    def draw(self, pose: np.ndarray, beside: Beside | None = None) -> np.ndarray:
        """Render bodies at `pose` (nb, 7) as (height, width, 3) bytes of red, green and blue."""
        beside = Beside.of() if beside is None else beside
        places, normals = (
            np.concatenate(pair)
            for pair in zip(self._placed(pose), (beside.places, beside.normals))
        )
        colors = np.concatenate((self._colors, beside.colors))
        opacity = np.concatenate((self._opacity, beside.opacity))
        faces = np.arange(len(places), dtype=np.int32).reshape(-1, 3)
        camera = self.camera(pose)
        points = self._projected(places, camera)
        self._depth.fill(0.0)
        self._seen.fill(NO_FACE)
        cover(points, faces, opacity, self._depth, self._seen)
        sun = self._sun(places)
        shadows, unused = self._shade
        shadows.fill(-np.inf)
        off = places - np.array(sun.origin)
        cover(off @ np.array((sun.x, sun.y, sun.w)).T, faces, opacity, shadows, unused)
        light(
            self._picture, self._depth, self._seen, points, faces, places, normals, colors,
            shadows, camera, sun, self.ground, self.tones,
        )  # fmt: skip
        shown = np.empty((self.size[1], self.size[0], 3), np.uint8)
        developed(self._picture, CODES, shown)
        return shown

    def faces(self, pose: np.ndarray, color: Sequence[int], opacity: float) -> Beside:
        """Return the faces of the bodies at `pose` (nb, 7) in one colour."""
        places, normals = self._placed(pose)
        corners = len(self._owners)  # those after them are of the ground
        colors = np.tile(linear(color), (corners // 3, 1))
        opacities = np.full(corners // 3, opacity)
        return Beside(places[:corners], normals[:corners], colors, opacities)

    # -- what is drawn -----------------------------------------------------------------------------

    def _solids(self, found: Sequence[Any]) -> None:
        """Build the corners of all faces in body axes, with normals, colours and body numbers."""
        places, normals, colors, owners, opacity = [], [], [], [], []
        for k, look in enumerate(found):
            for piece in look.pieces:
                solid = shapes.mesh([piece])
                corners = np.asarray(solid.vertices)[solid.faces]
                places.append(corners.reshape(-1, 3))
                normals.append(_normals(corners))
                colors.append(np.repeat([linear(piece.color or look.color)], len(corners), axis=0))
                opacity.append(np.full(len(corners), piece.opacity))
                owners.append(np.full(3 * len(corners), k))
        empty = np.zeros((0, 3))
        self._places = np.concatenate([empty, *places])
        self._normals = np.concatenate([empty, *normals])
        self._colors = np.concatenate([empty, *colors])
        self._opacity = np.concatenate([np.zeros(0), *opacity])
        self._owners = np.concatenate([np.zeros(0, int), *owners])

    def _steps(self, model: Any) -> None:
        """Add the steps on the ground, which belong to no body."""
        for step in model.ground.steps:
            corners = stage.solid(model, step)[np.array(stage.BOX)]
            self._places = np.concatenate((self._places, corners.reshape(-1, 3)))
            self._normals = np.concatenate((self._normals, _normals(corners)))
            self._colors = np.concatenate((self._colors, [linear(stage.STEP)] * len(corners)))
            self._opacity = np.concatenate((self._opacity, np.ones(len(corners))))

    def _placed(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Transform corners and normals to world axes."""
        places, normals, count = self._places.copy(), self._normals.copy(), len(self._owners)
        turns = shapes.to_matrix(pose[:, 3:])[self._owners]
        places[:count] = np.einsum("nij,nj->ni", turns, places[:count])
        places[:count] += pose[self._owners, :3]
        normals[:count] = np.einsum("nij,nj->ni", turns, normals[:count])
        return places, normals

    # -- where it is seen from -----------------------------------------------------------------

    def on_screen(self, places: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Project points (n, 3) at `pose` to x and y [pixels] and 1/depth [1/m], (n, 3).

        Not finite behind the camera.
        """
        return self._projected(places, self.camera(pose)) / (OVERSAMPLING, OVERSAMPLING, 1.0)

    def camera(self, pose: np.ndarray) -> Camera:
        """Return the camera for bodies at `pose` (nb, 7)."""
        width, height = self.size[0] * OVERSAMPLING, self.size[1] * OVERSAMPLING
        step = 2 * np.tan(stage.FRAMING.field_of_view / 2) / height
        corner = -self._way - self._right * step * width / 2 + self._above * step * height / 2
        eye = self._view.position + self.track.gone(pose)
        return Camera._make(map(_three, (eye, corner, self._right * step, -self._above * step)))

    def _projected(self, places: np.ndarray, camera: Camera) -> np.ndarray:
        off = places - np.array(camera.eye)
        deep = -off @ self._way
        deep = np.where(deep > 1e-3 * self._reach, deep, np.nan)
        pixel = float(np.linalg.norm(camera.right))
        x = off @ self._right / deep / pixel + self.size[0] * OVERSAMPLING / 2
        y = -(off @ self._above) / deep / pixel + self.size[1] * OVERSAMPLING / 2
        return np.column_stack((x, y, 1.0 / deep))

    def _sun(self, places: np.ndarray) -> Sun:
        """Return the sun, with a shadow map that covers all bodies."""
        towards = self.towards_sun
        right, above = stage.frame(self.up, towards)
        near = places[: len(self._owners)] if len(self._owners) else np.zeros((1, 3))
        low, high = near.min(axis=0), near.max(axis=0)
        middle, edge = (low + high) / 2, 1.1 * max(float(np.linalg.norm(high - low)), 1e-6)
        origin = middle - edge / 2 * right + edge / 2 * above
        finer = SHADOWS / edge
        axes = (towards, origin, right * finer, -above * finer, towards)
        return Sun._make((*map(_three, axes), edge / SHADOWS))

    def _plane(self, model: Any, low: float) -> Ground:
        normal = np.asarray(model.ground_normal, float)
        cell = shapes.spaced(self._reach) / 5
        along = [axis for axis in np.eye(3) if axis @ self.up == 0]
        u, v = ((axis - (axis @ normal) * normal) / cell for axis in along)
        point = -low * self.up
        return Ground._make((*map(_three, (point, normal, u, v)), 9 * self._reach))


def checked_size(size: Any) -> tuple[int, int]:
    """Return (width, height) in pixels. Raises InputError."""
    try:
        width, height = (int(n) for n in size)
        whole = (width, height) == tuple(size)
    except (TypeError, ValueError, OverflowError):
        width, height, whole = 0, 0, False
    if not whole or not all(LEAST_PIXELS <= n <= MOST_PIXELS for n in (width, height)):
        text = f"must be (width, height), {LEAST_PIXELS} to {MOST_PIXELS} pixels each, got {size!r}"
        raise InputError(Problem("picture", "size", text))
    if width * height > MOST_IN_ALL:
        text = f"has {width * height:.3g} pixels, {MOST_IN_ALL:.3g} at most, got {size!r}"
        raise InputError(Problem("picture", "size", text))
    return width, height


def tones(of: stage.Tones, up: str) -> Tones:
    """Return a page theme as linear light."""
    rim = np.array(stage.turned(stage.RIM, up)) / np.linalg.norm(stage.RIM)
    strengths = of.around, of.around, of.key, of.rim
    colors = of.above, of.below, stage.WARM, stage.COOL
    lights = [x / np.pi * np.array(linear(color)) for x, color in zip(strengths, colors)]
    colors = (of.canvas, of.floor, of.line)
    return Tones._make((*map(linear, colors), *map(_three, (*lights, rim)), of.shadow))


def _coded(light: np.ndarray) -> np.ndarray:
    """Convert linear light from 0 to 1 to sRGB bytes (IEC 61966-2-1)."""
    curved = 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055
    return np.round(255 * np.where(light <= 0.0031308, 12.92 * light, curved)).astype(np.uint8)


CODES = _coded(np.linspace(0.0, 1.0, 16385))


def linear(color: Sequence[int]) -> tuple[float, float, float]:
    """Convert an sRGB colour to linear light (IEC 61966-2-1)."""
    c = np.asarray(color) / 255.0
    return _three(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))


def _three(x: Any) -> tuple[float, float, float]:
    a, b, c = (float(one) for one in x)
    return a, b, c


def _normals(corners: np.ndarray, crease: float = 0.6) -> np.ndarray:
    """Return (3 m, 3) vertex normals for faces (m, 3, 3), averaged over adjoining faces without a
    crease.

    Normals are weighted by area, and coincident corners are merged. Edges with an angle of more
    than `crease` [rad] between their faces are visible.
    """
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    off = corners.reshape(-1, 3) - corners.reshape(-1, 3).min(axis=0, initial=np.inf)
    bits = np.round(off / (off.max(initial=0.0) or 1.0) * (1 << 20)).astype(np.int64)
    _, vertex = np.unique(bits @ [1, 1 << 21, 1 << 42], return_inverse=True)
    owner = np.repeat(np.arange(len(corners)), 3)
    order = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex)
    starts = np.cumsum(counts) - counts
    found = np.zeros((len(owner), 3))
    for k in range(int(counts.max(initial=0))):  # the k-th face at the vertex of each corner
        has = counts[vertex] > k
        other = owner[order[(starts[vertex] + k)[has]]]
        near = (unit[owner[has]] * unit[other]).sum(axis=1) > np.cos(crease)
        rows = np.flatnonzero(has)[near]
        found[rows] += flat[other[near]]
    lengths = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(lengths > 0, found / np.maximum(lengths, 1e-300), unit[owner])
