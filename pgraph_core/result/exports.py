"""Export of runs to tables, pictures, films, pages and files (`.npz`).

A compressed file of a few megabytes can expand to gigabytes. Times are read as long as they are
ascending. The size of all other arrays is limited by the size of the model.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy

from .. import hooks
from ..errors import FileError, InputError, PgraphError, Problem, explained
from ..markup import ordinary, reason_of
from ..model import Model
from ..model.files import LARGEST, gathered, shown_path, write_atomic
from ..packing import Array
from .columns import Column, columns_of, dataset, frame, matlab, no_column
from .records import (
    OF_CONSTRAINTS,
    OF_DRIVES,
    ContactRecord,
    Derivatives,
    Memory,
    Named,
    Status,
    event_arrays,
    events_of_arrays,
)

if TYPE_CHECKING:
    from ..mechanism import Mechanism

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a cell that begins so is calculated
WRITTEN = "give a file written by Result.save"


def _show() -> Any:
    from .. import show

    return show


FIGURE = 560  # [pixels] height of the figure of a run in a notebook


@explained
class Exports:
    """The methods of a `Result` that write it for people and other programs."""

    mechanism: Mechanism
    t: Array
    _meant: Callable[[str], dict[str, Column]]

    def to_pandas(self, *, bodies: bool = False) -> Any:
        """Return a pandas DataFrame of `columns` with one row per frame, indexed by time t [s].

        Text columns, such as the phases of contacts, are omitted. `table["trunk"]` returns all
        columns of the joint. An unknown name raises a KeyError that lists the columns.
        `table.attrs["units"]` contains the units. `bodies` as for `columns`. Needs pandas.
        """
        return frame(columns_of(self, bodies))

    def to_xarray(self, *, bodies: bool = False) -> Any:
        """Return an xarray Dataset of `columns` over time t [s], with units.

        Columns of words are omitted. `bodies` as for `columns`. Needs xarray.
        """
        return dataset(columns_of(self, bodies))

    def plot(self, *names: str) -> Any:
        """Plot columns over time with Matplotlib, by default all coordinates.

        Parameters
        ----------
        names : str
            Names of columns, or the beginnings of several: "knee", "v", "energy", "contact_force".

        Returns
        -------
        Figure
            A Matplotlib figure.

        Raises
        ------
        InputError
            If no column has such a name.

        Examples
        --------
            run.plot("knee", "energy").savefig("knee.png")
        """
        picked = dict[str, Column]()
        for name in names or ("q",):
            found = self._meant(name)
            found.pop("t", None)
            if not found and names:
                raise InputError(Problem("plot", "", no_column(columns_of(self, True), name)))
            picked |= found
        return _show().figure(self.t, picked, self.mechanism.model.name)

    def to_html(
        self, path: str | Path | None = None, /, *, live: bool = False, open: Sequence[str] = ()
    ) -> str | None:
        """Write the run as a 3D figure in one self-contained HTML file, or return its text.

        Parameters
        ----------
        path : str or path, optional
            The file to write. Without one the text is returned.
        live : bool
            Whether readers can run the mechanism and pull on it (docs/gallery.md). Otherwise the
            figure plays the run.
        open : iterable of str
            Fields that readers can change in a live figure, PATH or PATH=low:high, such as
            "bodies.lower.mass=0.2:5".

        Raises
        ------
        InputError
            If a field cannot be changed in the figure.
        FileError
            If the file has another suffix or cannot be written.
        """
        if path is not None and Path(path).suffix.lower() not in (".html", ".htm"):
            text = "is not a web page; give a name that ends in .html"
            raise FileError(Problem(str(path), "", text))
        page = hooks.page(self, open, live or bool(open))
        return page if path is None else write_atomic(path, page)

    def to_image(
        self, path: str | Path, /, *, t: float | None = None, size: tuple[int, int] = (1280, 720),
        view: str = "start", dark: bool = False, beside: Self | None = None,
    ) -> None:  # fmt: skip
        """Draw the mechanism in 3D at one instant of the run. No display is needed.

        Parameters
        ----------
        path : str or path
            The file to write, with the suffix .png.
        t : float, optional
            Time [s], by default the start.
        size : (int, int)
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether the background is dark.
        beside : Result, optional
            Another run, of any model, whose bodies are drawn in grey at the same time.

        Raises
        ------
        InputError, FileError
            If arguments are invalid or the file cannot be written.
        """
        from ..show import pictures  # with its kernels

        look = {"size": size, "view": view, "dark": dark}
        write_atomic(path, pictures.moment(self, path, t, other=beside, **look))

    def to_film(
        self, path: str | Path, /, *, size: tuple[int, int] = (960, 540), fps: float = 30,
        speed: float = 1.0, view: str = "start", dark: bool = False,
        progress: Callable[[float], Any] | None = None, beside: Self | None = None,
    ) -> None:  # fmt: skip
        """Write a video of the run.

        Parameters
        ----------
        path : str or path
            The file to write, .mp4 (H.264) or .gif.
        speed : float
            Playback speed: 0.5 plays at half speed.
        fps : float
            Pictures per second.
        size : (int, int)
            Width and height in pixels.
        view : {"start", "front", "side", "top", "isometric"}
            Direction of the view.
        dark : bool
            Whether the background is dark.
        progress : callable, optional
            Function of the completed fraction, called after each frame. Nothing is written if it
            returns False.
        beside : Result, optional
            Another run, of any model, whose bodies are drawn in grey at the same times.

        Raises
        ------
        InputError, FileError
            If arguments are invalid or the file cannot be written.
        MissingPackage
            If a required package is not installed.
        """
        options = {"size": size, "fps": fps, "speed": speed, "view": view, "dark": dark}
        from ..show import pictures

        made = pictures.film(self, path, **options, progress=progress, other=beside)
        if made is not None:
            write_atomic(path, made)

    def animate(self, path: str | Path | None = None, /, **options: Any) -> Any:
        """Write a film as `to_film`, or return the run, which a notebook shows as an animation."""
        return self if path is None else self.to_film(path, **options)

    def show(self) -> Any:
        """Show the figure. Returns an object to display in a notebook, or opens a browser."""
        return _show().opened(hooks.page(self))

    def _repr_html_(self) -> str:
        """Return the summary with a figure, which is live if the browser can compute it."""
        facts = _show().run_html(self)
        if not len(self.t) or not self.mechanism.names:
            return facts
        return facts + _show().Embedded(hooks.page(self), FIGURE)._repr_html_()

    def save(self, path: str | Path, /) -> None:
        """Save the run with its model, or its columns as a table.

        Parameters
        ----------
        path : path
            A `.npz` file contains the run with its model, and meshes from other folders are copied
            to `meshes` next to it. A `.csv` file is a table. A `.mat` file (MATLAB, Octave) has one
            variable per column, with `_` in place of characters other than letters and digits, and
            the lists `names` and `units`. An `.mcap` file (Foxglove) and an `.rrd` file (Rerun)
            have the poses and shapes of all bodies, all columns and the events
            (docs/files_of_others.md).

        Raises
        ------
        FileError
            If the file cannot be written or has another suffix.
        MissingPackage
            If the package that an `.mcap` or `.rrd` file needs is not installed.
        """
        suffix = Path(path).suffix.lower()
        if suffix == ".csv":
            self.to_csv(path)
            return
        if suffix == ".mat":
            write_atomic(path, matlab(columns_of(self)))
            return
        if suffix in (".mcap", ".rrd"):
            from . import logs

            write_atomic(path, logs.mcap_of(self) if suffix == ".mcap" else logs.rrd_of(self))
            return
        if suffix != ".npz":
            text = "must end in .npz (the whole run), .csv or .mat (tables), .mcap or .rrd (logs); "
            text += "to_html makes a figure, to_film a film"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, file_of(self, Path(path).parent))

    def to_rerun(self) -> Any:
        """Return the run as a `rerun.RecordingStream`, with the content of an `.rrd` file.

        Raises
        ------
        MissingPackage
            If Rerun is not installed.

        Examples
        --------
            run.to_rerun().spawn()  # in its viewer
        """
        from . import logs

        return logs.rerun_of(self)

    @classmethod
    def load(cls, path: str | Path, /, *, roots: Iterable[str | Path] = ()) -> Self:
        """Load a run that `save` wrote.

        Parameters
        ----------
        path : path
            An `.npz` file.
        roots : iterable of paths, optional
            Additional folders for meshes.

        Raises
        ------
        FileError
            If the file cannot be read.
        ModelError
            If its model is not valid.
        """
        try:
            file = ordinary(path)
        except (OSError, ValueError) as error:
            reason = reason_of(error)
            text = f"cannot be read: {reason[:1].lower()}{reason[1:]}; {WRITTEN}"
            raise FileError(Problem(shown_path(path), "", text)) from None
        try:
            with file:
                if file.read(2) != b"PK":  # the first bytes of a zip file, hence of an .npz file
                    text = f"is not a saved run (.npz); {WRITTEN}"
                    raise FileError(Problem(str(path), "", text))
                given = fields_of(ZipFile(file), path, roots)
                status = Status(Status.__members__.get(given["status"]))
                return cls(**{**given, "status": status})
        except PgraphError:
            raise
        except KeyError as missing:
            text = f"is incomplete: {missing} is missing; {WRITTEN}"
        except (TypeError, ValueError, AttributeError):
            text = f"does not contain a complete run; {WRITTEN}"
        except Exception:  # zip, zlib, numpy and its parser raise any error on damaged files
            text = (
                "is damaged and cannot be read as a run; save the run again, or copy the file again"
            )
        raise FileError(Problem(str(path), "", text))

    def to_csv(self, path: str | Path | None = None, /, *, bodies: bool = False) -> str:
        """Return `columns` as CSV text with units in the header line, "knee [rad]".

        A name that a spreadsheet would interpret as a formula begins with a quote. The text is
        also written to a `path`, if one is given. `bodies` as for `columns`. Raises FileError.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        columns = columns_of(self, bodies)
        heads = (f"{name} [{c.unit}]" if c.unit else name for name, c in columns.items())
        writer.writerow(f"'{head}" if head[:1] in FORMULA else head for head in heads)
        writer.writerows(zip(*(c.values.tolist() for c in columns.values())))
        if path is not None:
            write_atomic(path, text.getvalue())
        return text.getvalue()

    def columns(self, *, bodies: bool = False) -> dict[str, Any]:
        """Return the columns of the run as a table {name: (n,)}.

        A coordinate has the name of its body, "knee". Every other column begins with the name of
        its quantity: "v.knee", "energy", "contact_force.paw.z". `to_csv` adds the units.

        Parameters
        ----------
        bodies : bool, optional
            Whether to add the motion of all body frames in world axes and the wrenches of their
            joints: "position.hand.x", "angular_acceleration.hand.z", "joint_force.hand.x".
            `run["position.hand"]` and `run.plot("velocity.hand")` work regardless of this argument.
        """
        return {name: column.values for name, column in columns_of(self, bodies).items()}


# -- the file of a run ----------------------------------------------------------------------------

BLOCK = 1 << 16  # [bytes] block size for reading times
PER_BODY = 7 * 8  # [bytes] most that a body has in a frame of one array: the place of a free joint
ARRAYS = (
    "t", "q", "v", "vdot", "kinetic_energy", "potential_energy", "work", "dissipation",
    "constraint_drift", "error_at", "states", "state_error_at", "force_error_at", "space_error_at",
)  # fmt: skip
SCALARS = ("message", "counters", "timing", "header", "notices")
# before the names of constraints, drives and paths
FORCE, DRIVE, DERIVATIVE, MEMORY = "force:", "drive:", "derivative:", "memory:"


def file_of(run: Any, folder: Path) -> bytes:
    """Return the file of a run. Meshes from other folders are copied to the folder if it exists."""
    model = run.mechanism.model.described
    if folder.is_dir():
        model = model.unchecked_copy({"bodies": gathered(model.bodies, folder)})
    arrays = {name: getattr(run, name) for name in ARRAYS}
    arrays |= {FORCE + name: value for name, value in run.constraint_force.items()}
    arrays |= {DRIVE + name: value for name, value in run.drive_force.items()}
    arrays |= {DERIVATIVE + path: value for path, value in run.derivatives.items()}
    arrays |= {MEMORY + name: array for name, array in (run.memory or {}).items()}
    arrays |= run.contacts.arrays() | event_arrays(run.user_events)
    header = {
        "status": run.status.name,
        **{name: getattr(run, name) for name in SCALARS},
        "model": json.loads(model.to_json()),
        "segments": run.mechanism.model.segments,
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, header=np.array(json.dumps(header)), **arrays)
    return buffer.getvalue()


def fields_of(file: ZipFile, path: str | Path, roots: Iterable[str | Path]) -> dict[str, Any]:
    """Return the fields of a run, with the name of its status.

    Raises KeyError, TypeError, ValueError or FileError.
    """
    from ..mechanism import Mechanism

    header = dict(json.loads(str(_array(file, "header", 4 * LARGEST))))
    description, folder = json.dumps(header.pop("model")), Path(path).parent
    model = Model.from_json(description, source=str(path), folder=folder, roots=roots)
    if segments := header.pop("segments", None):
        model = model.with_segments(segments)
    arrays = arrays_of(file, len(model.bodies) + len(model.stateful))
    n = len(arrays["t"])
    arrays.setdefault("states", np.zeros((n, 0)))  # older files have none
    arrays.setdefault("state_error_at", np.full((n, arrays["states"].shape[1]), np.nan))
    arrays.setdefault("force_error_at", np.full(n, np.nan))
    arrays.setdefault("space_error_at", np.zeros(n))
    found = {name: header[name] for name in SCALARS} | {name: arrays[name] for name in ARRAYS}
    forces, driven, derivatives, memory = (
        {k.removeprefix(prefix): a for k, a in arrays.items() if k.startswith(prefix)}
        for prefix in (FORCE, DRIVE, DERIVATIVE, MEMORY)
    )
    mech = Mechanism(model)
    fits = found["q"].shape[1:] == (mech.nq,) and found["v"].shape[1:] == (mech.nv,)
    if not fits or len({len(found[name]) for name in ARRAYS}) != 1:
        raise ValueError("arrays of different lengths")
    shape = len(found["t"]), mech.nq + mech.nv + 2 + 2 * found["states"].shape[1]
    if any(x.shape != shape for x in derivatives.values()):
        raise ValueError("derivatives of another shape")
    return {
        **found,
        "mechanism": mech,
        "status": header["status"],
        "notices": tuple(found["notices"]),
        "constraint_force": Named(forces, *OF_CONSTRAINTS),
        "drive_force": Named(driven, *OF_DRIVES),
        "contacts": ContactRecord.of_arrays(arrays),
        "user_events": events_of_arrays(arrays),
        "derivatives": Derivatives(derivatives),
        "memory": Memory(memory) if memory else None,
    }


def arrays_of(file: ZipFile, bodies: int) -> dict[str, Array]:
    """Return the arrays by name. Raises KeyError or ValueError."""
    found = {"t": _times(file)}
    most = len(found["t"]) * PER_BODY * (bodies + 1)
    for name in (
        entry.removesuffix(".npy") for entry in file.namelist()
    ):  # the order of the columns
        if name not in ("header", "t"):  # events are not of frames
            own = "event" in name or name.startswith(MEMORY)
            found[name] = _array(file, name, LARGEST if own else most)
    return found


def _array(file: ZipFile, name: str, most: int) -> Array:
    if f"{name}.npy" not in file.namelist():
        raise KeyError(name)
    with file.open(f"{name}.npy") as entry:
        shape, kind = _head(entry)
        if math.prod(shape) * kind.itemsize > most:
            raise ValueError(f"{name} has more numbers than its model can have")
    with file.open(f"{name}.npy") as entry:
        return npy.read_array(entry, allow_pickle=False)


def _times(file: ZipFile) -> Array:
    """Return the times, reading only as far as they ascend."""
    parts = [np.full(1, -np.inf)]
    with file.open("t.npy") as entry:
        (count,), kind = _head(entry)
        while content := entry.read(BLOCK):
            parts.append(np.frombuffer(content, kind))
            if not (np.diff(parts[-1], prepend=parts[-2][-1]) > 0).all():
                raise ValueError("t does not ascend")
    found = np.concatenate(parts[1:]) if count else np.zeros(0)
    if found.shape != (count,):
        raise ValueError("t is cut short")
    return found


def _head(entry: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(entry)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = read(entry)
    return shape, kind
