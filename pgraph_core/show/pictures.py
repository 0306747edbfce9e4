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
from typing import Any

import numpy as np

from ..errors import FileError, InputError, Problem, needed
from .digraph import digraph_svg
from .drawing import Drawing, checked_size
from .notebook import between, digraph_of

DPI = 100  # resolution of plots, whose size is in pixels
LONGEST_FILM = 20_000  # limit on the frames of a film
MOST_OF_A_GIF = 1_000_000_000  # limit on the pixels of all its frames, one byte each
GIF_RATES = (50, 33, 25, 20, 10, 5, 2, 1)  # frames a second that viewers of GIF keep
QUALITY = "20"  # constant rate factor of x264: 18 looks like the original, 28 is coarse
Progress = Callable[[float], Any] | None


# -- pictures --------------------------------------------------------------------------------------


def view(
    model: Any, pose: np.ndarray, path: str | Path, *,
    size: tuple[int, int] = (1280, 720), view: Any = "start", dark: bool = False,
) -> bytes:  # fmt: skip
    """Return a picture of a model with bodies at `pose` (nb, 7), ordered by number.

    Raises InputError, FileError.
    """
    _suffix(path, (".png",), "picture")
    return png(Drawing(model, pose[None], size, view=view, dark=dark).draw(pose))


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


def moment(run: Any, path: str | Path, t: float | None = None, **look: Any) -> bytes:
    """Return a picture of a run at time t [s], by default at its start. Raises InputError."""
    times, poses = np.asarray(run.t), np.asarray(run.body_pose)
    t = float(times[0]) if t is None else t
    if not (isinstance(t, (int, float, np.integer, np.floating)) and times[0] <= t <= times[-1]):
        text = f"must be a time of the run, {times[0]:g} to {times[-1]:g} s, got {t!r}"
        raise InputError(Problem("to_image", "t", text))
    return view(run.mechanism.model, np.column_stack(between(times, poses, t)), path, **look)


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
) -> bytes | None:  # fmt: skip
    """Return a video of a run, or None if `progress(fraction)` returns False after a frame.

    `speed=0.5` plays at half speed. Raises InputError, FileError, MissingPackage.
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
    drawing = Drawing(run.mechanism.model, poses, size, view=view, dark=dark)
    for k in range(count):
        time = min(times[0] + k / fps * speed, times[-1])
        made.add(drawing.draw(np.column_stack(between(times, poses, float(time)))))
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
