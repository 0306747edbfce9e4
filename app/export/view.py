"""Export of a run to files, which are created in a thread and sent to the requesting page."""

from __future__ import annotations

import re
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core import InputError
from pgraph_core.errors import Problem

from ..core.bridge import Bridge
from ..core.views import Host, Place
from ..model.archive import zipped
from ..run import Run
from ..scene.solids import drawn_beside
from . import Exporting, State

OFTEN = 0.2  # [s] between reports of how far a film is
OPEN = 8  # masses that the reader of a living figure may change


class ExportView:
    """Creates files in a thread and sends them to their pages, one at a time per page."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._making: dict[int, Exporting] = {}  # by page; another one or none: it is cancelled

    def render(self, old: State, new: State) -> None:
        asked, before = new.exporting, old.exporting
        if asked is None and before is not None and self._making.get(before.client) is before:
            del self._making[before.client]
        if asked is not None and asked is not before:
            threading.Thread(
                target=self._send, args=(asked,), name="pgraph-export", daemon=True
            ).start()

    def _send(self, asked: Exporting) -> None:
        client, told = asked.client, 0.0
        handle = self._bridge.server.get_clients().get(client)
        if handle is None:
            return
        if client in self._making:
            text = "The previous file is still being made; try again when it is ready."
            self._refuse(client, text)
            return
        self._making[client] = asked

        def progress(fraction: float) -> bool:
            nonlocal told
            if time.monotonic() - told > OFTEN:
                told = time.monotonic()
                self._bridge.send(client, "making", {"fraction": float(fraction)})
            return self._making.get(client) is asked

        if asked.what == "live" and (why := recorded_only(asked.run)):
            text = f"Readers can play the run but not change it: {why}."
            self._bridge.send(
                client, "notice", {"title": "A recording", "text": text, "bad": False}
            )
        name = re.sub(r"[^\w-]+", "_", asked.run.model.name) or "run"
        try:
            suffix, content, report = made(asked, progress)
        except Exception as error:  # shown on the page: the session goes on
            self._refuse(client, f"{type(error).__name__}: {error}")
            return
        finally:
            if self._making.get(client) is asked:
                del self._making[client]
            self._bridge.send(client, "making", None)
        if content:
            self._bridge.download(client, f"{name}.{suffix}", content)
        if report is not None:
            self._bridge.send(client, "conversion", report.to_dict())

    def _refuse(self, client: int, text: str) -> None:
        self._bridge.send(client, "notice", {"title": "Not exported", "text": text, "bad": True})


class Made(NamedTuple):
    """A file of a run. There is no content if it was cancelled."""

    suffix: str
    content: bytes
    report: pg.Report | None = None  # report on what the file contains and what it cannot


def made(asked: Exporting, progress: Callable[[float], bool] = lambda fraction: True) -> Made:
    """Return the requested file."""
    match asked.what:
        case "csv":
            return Made("csv", table(asked.run))
        case "npz":
            return Made(*arrays(asked.run))
        case "live":
            return Made("live.html", living(asked.run))
        case "fmu":
            return Made("fmu", *unit(asked.run))
        case "png" | "mp4" | "gif":
            return Made(asked.what, drawn(asked, progress))
    raise ValueError(asked.what)


def table(run: Run) -> bytes:
    """Return a table of all quantities over time, with units in the first line."""
    return run.result.to_csv(bodies=True).encode()


def arrays(run: Run) -> tuple[str, bytes]:
    """Return (suffix, content) for the run with its model, readable by `pg.Result.load`.

    If there are meshes, the result is a zip file that includes them.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        run.result.save(path)
        if any(file.is_dir() for file in path.parent.iterdir()):
            return "zip", zipped(path.parent)
        return "npz", path.read_bytes()


def living(run: Run) -> bytes:
    """Return a standalone HTML file in which the reader can run the mechanism.

    Masses can be changed in the figure if the browser supports it.
    """
    from pgraph_core.live.export import page  # compiles kernels of its own

    heavy = [body.name for body in run.model.bodies if body.mass > 0 and "." not in body.name]
    try:
        return page(run.result, [f"bodies.{name}.mass" for name in heavy[:OPEN]]).encode()
    except InputError:
        return page(run.result).encode()


def unit(run: Run) -> tuple[bytes, pg.Report]:
    """Return an FMU of the model, with the scenario, method and step of the run if these travel.

    The report lists its inputs, outputs and parameters, and what cannot travel.

    Raises InputError if something cannot travel, with the reason.
    """
    from pgraph_core.live.run import SMOOTH, TOUCHING

    header = run.result.header
    if header.get("given_torques"):
        text = "its torques come from Python, which an FMU does not run; write them as expressions"
        raise InputError(Problem("FMU", "", text))
    method = header["method"] if header["method"] in (*SMOOTH, *TOUCHING) else "auto"
    steps = {"step": header["step"]} if header["rtol"] is None else {"rtol": header["rtol"]}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{re.sub(r'[^A-Za-z0-9_]+', '_', run.model.name) or 'model'}.fmu"
        given = {"method": method, **steps} if method != "auto" else {}
        report = pg.write_fmu(run.model, path, scenario=header["scenario"], **given)
        return path.read_bytes(), report


def recorded_only(run: Run) -> str:
    """Return the reason why the living figure of a run only plays it, or ""."""
    from pgraph_core.live.export import why_recorded  # compiles kernels of its own

    return why_recorded(run.result)


def drawn(asked: Exporting, progress: Callable[[float], bool]) -> bytes:
    """Render a picture of the run at the time shown, or a film of it, without a page.

    Springs, rods, loads and forces are drawn as far as the page shows them.
    """
    from pgraph_core.show import pictures  # compiles kernels of its own

    run, extra = asked.run.result, drawn_beside(asked.run, asked.shown)
    path = f"run.{asked.what}"
    if asked.what in ("mp4", "gif"):
        return pictures.film(run, path, progress=progress, extra=extra) or b""
    t = float(np.clip(asked.time, run.t[0], run.t[-1]))
    return pictures.moment(run, path, t, extra=extra)


VIEWS = (Place(lambda desk: ExportView(desk.bridge), 74, Host("export", "top", order=55)),)
