"""Background threads for long work: simulations, compiling the kernels, writing files.

Each follows the state like a view and answers with events.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable

import pgraph_core as pg
from pgraph_core.engine.compiler.archive import current

from ..core.events import Event
from . import FREE_RUN, Job, State
from .update import Compiled, Compiling, Failed, Progress, Simulated

COMPILE = ("-m", "pgraph_core.engine", "--with-parent")
REPORT = 0.05  # [s] between progress events

Send = Callable[[Event], None]


class Simulator:
    """Runs the state's job in a thread once the kernels are ready, and cancels dropped jobs."""

    def __init__(self, send: Send):
        self._send = send
        self._running = 0  # id of the job that was started last
        self._cancelled = threading.Event()

    def render(self, old: State, new: State) -> None:
        job = new.job
        if old.job is not None and (job is None or job.id != old.job.id):
            self._cancelled.set()
        if job is None or job.id == self._running or not new.kernels.ready:
            return
        self._running, self._cancelled = job.id, threading.Event()
        args = (job, self._cancelled)
        threading.Thread(target=self._run, args=args, name="pgraph-run", daemon=True).start()

    def _run(self, job: Job, cancelled: threading.Event) -> None:
        reported = time.perf_counter()

        def progress(fraction: float) -> bool:
            nonlocal reported
            now = time.perf_counter()
            if now - reported > REPORT:
                reported = now
                self._send(Progress(job.id, float(fraction)))
            return not cancelled.is_set()

        try:
            self._send(Simulated(job.id, simulated(job, progress)))
        except pg.PgraphError as error:
            self._send(Failed(job.id, str(error)))
        except Exception as error:  # said on the page: the session goes on
            self._send(Failed(job.id, f"The simulation stopped: {type(error).__name__}: {error}"))


def simulated(job: Job, progress: Callable[[float], bool]) -> object:
    """Return the result of a job."""
    request, before = job.request, job.before
    start = 0.0 if before is None else float(before.t[-1])
    mech = pg.Mechanism(job.model)
    run = pg.simulate(
        mech,
        *((None, None) if before is None else (before.q[-1], before.v[-1])),
        t_start=start,
        t_end=start + request.t_end,
        step=request.step,
        rtol=request.rtol,
        method=request.method,
        scenario=None if request.scenario == FREE_RUN else request.scenario,
        tau=None if job.gait is None else pg.Controller(mech, job.gait),
        progress=progress,
    )
    return run if before is None or len(run.t) == 0 else pg.joined((before, run))


def why_compiled() -> str:
    """Return the reason why numba must compile kernels for usual runs, or ""."""
    found = current()
    return found.problem or next(map(found.why, found.stale()), "")


class Compiler:
    """Compiles kernels in a separate process if the package contains none that fit.

    Where it does, a run loads what it needs by itself, in a second or two at the first start.
    """

    def __init__(
        self,
        send: Send,
        command: tuple[str, ...] = COMPILE,
        why: Callable[[], str] = why_compiled,
    ):
        self._send, self._why = send, why
        self._command = (sys.executable, *command)
        self._process: subprocess.Popen[str] | None = None
        threading.Thread(target=self._watch, name="pgraph-compile", daemon=True).start()

    def stop(self) -> None:
        """End the process."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()

    def _watch(self) -> None:
        if not self._why():
            self._send(Compiled())
            return
        said = ""
        with subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,  # closed by our death, of whatever kind
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            self._process = process
            assert process.stdout is not None
            for line in process.stdout:
                match line.split(maxsplit=2):
                    case [done, total, name] if done.isdigit() and total.isdigit():
                        self._send(Compiling(int(done), int(total), name.strip()))
                    case [*_] if line.strip():
                        said = line.strip()
                        print(said, file=sys.stderr, flush=True)
        self._send(Compiled(said if process.returncode else ""))
