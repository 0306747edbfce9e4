"""Trust in a run: a verdict in three levels and the lines of its outcome."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from pgraph_core.analysis.singular import TOO_LOW
from pgraph_core.errors import percent
from pgraph_core.integrators import METHODS
from pgraph_core.joints import units_of
from pgraph_core.model.settings import METHOD_NAMES
from pgraph_core.result.records import Status
from pgraph_core.tolerances import VISIBLE

from ..core.views import Payload
from . import Run, State

POOR = 1e-2  # relative error or drift above which a run is rough
WORDS = {"contact_fallbacks": "times contacts by the slower solver"}
LOADING = "Its fast code is being loaded. For a new kind of model it is compiled, up to a minute."
SPACE = "Error in space"
ERROR, ENERGY, LOOPS = "Error estimate", "Energy drift", "Constraint drift"
METHOD, NOTE = "Method", "Note"
SINGULAR = "More than one motion is possible from there. The report tells when it was passed."
FEWEST_METRES, FEWEST_DEGREES = 1e-6, 1e-3  # nobody feels less: it is shown as "within" these
Line = tuple[str, str, bool]  # label, value, True if it is good


def trust(
    state: State, job: Payload | None, kernels: Payload | None, live: Payload | None
) -> Payload:
    """Return level, sentence, reason, lines and progress for the right side of the time panel."""
    if state.job is not None:
        job, waits = job or {}, kernels is not None
        said = "Preparing" if waits else "Computing"
        text = kernels["text"] if kernels and waits else "" if job.get("fraction") else LOADING
        return _told("busy", said, text, fraction=job.get("fraction"))
    if live is not None:
        return _told("", f"Live, {live['text']}", state.run_problem)
    run = state.plotted
    if state.run_problem:
        return _told(
            "failed", "Not simulated" if run is None else "Last run failed", state.run_problem
        )
    if kernels is not None:
        return _told("busy", "Preparing", kernels["text"], fraction=kernels["fraction"])
    if state.instead:
        return _told("", "Motion capture", f"Play shows {state.instead}.")
    if run is None:
        why = f"Play computes {state.request.t_end:g} s of motion." if state.model.rows else ""
        return _told("", "No run yet", why)
    if state.earlier is not None:
        return _told(
            "unknown",
            "Model changed",
            "This run is of the model before your last edits. Play computes it again.",
            report=True,
        )
    level, said, why = verdict(run)
    lines = [] if level in ("failed", "unknown") else below(run)  # or the reason
    better = remedy(run) if level == "rough" else None
    return _told(level, said, why, lines, report=True, better=better)


def _told(
    level: str, said: str, why: str = "", lines: list[Any] | None = None, **more: Any
) -> Payload:
    return {"level": level, "said": said, "why": why, "lines": lines or [], "report": False, **more}


def verdict(run: Run) -> tuple[str, str, str]:
    """Return (level, sentence, reason) for a run. The level is "good", "rough", "unknown" or
    "failed".

    The level is determined by the worst entry of the summary. The error estimate is that of the
    positions.
    """
    result = run.result
    if result.status is Status.CANCELLED:
        text = (
            "You cancelled the rest; what there is can be played. Shift Space computes all of it."
        )
        return "unknown", f"Stopped at {float(result.t[-1]):.3g} s", text
    if not result.status.ok and not run.ended:
        return "failed", "Stopped early", result.message or result.status.value
    if math.isnan(float(result.error_estimate)):
        return "unknown", "Accuracy unknown", "No error was estimated for this run."
    if not math.isfinite(float(result.error_estimate)):
        return "unknown", f"Reliable {_until(result)}", f"The error is {result.accuracy}."
    doubts = [notice for notice in result.notices if TOO_LOW in notice]
    if doubts:
        return "unknown", "Uncertain: singular position", SINGULAR
    amount = felt(run)
    bad = {what: value for what, value, fine in summary(run) if not fine}
    if not bad:
        return "good", f"Good {amount if amount.startswith('within') else f'to {amount}'}", ""
    words = {ERROR: f"off by {amount}", ENERGY: f"energy drifts {drift(result)}"}
    if LOOPS in bad:
        words[LOOPS] = f"loops open by {length(float(result.constraint_drift[:, 0].max()))}"
    said = "; ".join(words.get(what, value) for what, value in bad.items())
    why = "; ".join(f"{what.lower()} {value}" for what, value in bad.items())
    return "rough", said[0].upper() + said[1:], why


def remedy(run: Run) -> tuple[str, str, str] | None:
    """Return how to improve a run, with the field of the settings and its text, or None."""
    step, rtol = (run.result.header.get(name) for name in ("step", "rtol"))
    if isinstance(step, float):
        return "halve the step", "step", f"{step / 2:.6g}"
    if isinstance(rtol, float):
        return "tighten the tolerance", "rtol", f"{rtol / 10:.3g}"
    return None


def _until(result: Any) -> str:
    """Return the last time at which the error is known, such as 'until 0.396 s'."""
    known = np.flatnonzero(np.isfinite(result.error_at))
    return f"until {float(result.t[known[-1] if len(known) else 0]):.3g} s"


def _first_order(result: Any) -> bool:
    """Check whether the errors of energies are of first order in the step size."""
    method = METHODS.get(str(result.header.get("method")))
    return method is not None and method.order == 1


def drift(result: Any) -> str:
    """Return the energy drift relative to its range, such as '4.9 %', or "" if it is unknown."""
    part = float(result.energy_drift)
    return "" if math.isnan(part) else percent(part)


def felt(run: Run) -> str:
    """Return the error estimate as lengths and angles, such as "about 3 mm, 0.2°"."""
    motions = [motion for body in run.model.expanded.bodies for motion in body.sequence]
    units = {unit for motion in motions for unit in units_of(motion)[1]}
    error, turns = float(run.result.error_estimate), "rad" in units
    small, parts = True, list[str]()
    if "m" in units or not turns:
        small &= error < FEWEST_METRES
        parts.append(length(max(error, FEWEST_METRES)))
    if turns:
        degrees = math.degrees(error)
        small &= degrees < FEWEST_DEGREES
        parts.append(f"{float(f'{max(degrees, FEWEST_DEGREES):.0e}'):g}°")
    return f"{'within' if small else 'about'} {', '.join(parts)}"


def supported(value: float, error: float) -> float:
    """Return `value` without the digits below its error in one digit, if that is known."""
    if not (0 < error < math.inf and math.isfinite(value)):
        return value
    return round(value, -math.floor(math.log10(float(f"{error:.0e}"))))


def length(metres: float) -> str:
    """Return a length with one digit in m, mm or µm."""
    scale, unit = next(u for u in ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")) if metres >= 0.95 * u[0])
    return f"{float(f'{metres / scale:.0e}'):g} {unit}"


def below(run: Run) -> list[tuple[str, str, bool, str]]:
    """Return the facts below a verdict, those that it does not say: what is good."""
    shown = (METHOD, ENERGY, ERROR, SPACE)
    return brief([line for line in summary(run) if line[0] in shown and line[2]])


def brief(lines: list[Line]) -> list[tuple[str, str, bool, str]]:
    """Return lines with their main value and their whole text. Problems are reported in full.

    Reasons come after a colon or a semicolon.
    """
    return [
        (what, re.split("[:;] ", text)[0] if good and what != NOTE else text, good, text)
        for what, text, good in lines
    ]


def outcome(state: State) -> list[tuple[str, str, bool, str]] | None:
    """Return the lines about the last run, which may belong to an earlier model."""
    if state.live is not None or state.plotted is None:
        return None
    lines = summary(state.plotted)
    if state.plotted.result.status is Status.DONE and not state.plotted.ended:
        lines = lines[1:]  # omit "reached its end"
    if state.earlier is None:
        return brief(lines)
    text = "of the model before your last edits; play again, or undo"
    return brief([("This run is", text, False), *lines])


def summary(run: Run) -> list[Line]:
    """Return lines (label, value, ok) about the end, accuracy and cost of a run.

    The energies of a first-order method have errors of first order even if the motion is accurate,
    so their drift is no fault of the motion.
    """
    result = run.result
    off, estimate = float(result.energy_drift), float(result.relative_error[-1:].sum())
    estimated = not math.isnan(estimate)
    lines = [
        ("Status", run.ended or result.message or result.status.value, result.status.ok),
        (METHOD, method(result), True),
        (
            ERROR,
            f"{_accuracy(run)}{why(run, estimate)}" if estimated else "",
            estimate < POOR,
        ),
        (ENERGY, f"{drift(result)}{why(run, off)}", off < POOR or _first_order(result)),
    ]
    if run.model.constraints and len(result.constraint_drift):
        position, velocity = result.constraint_drift.max(axis=0)
        value = f"{position:.2g} m, {velocity:.2g} m/s"
        lines.append((LOOPS, value, bool(position < POOR)))
    if run.model.beams and math.isfinite(result.space_error):
        counts = {name: sum(some) for name, some in run.whole.segments.items()}
        cells = ", ".join(f"{n} segments of {name}" for name, n in counts.items())
        rough = VISIBLE * max(beam.extent for beam in run.model.beams)
        lines.append((SPACE, f"{length(result.space_error)}: {cells}", result.space_error < rough))
    lines.append(("Cost", cost(result), True))
    lines += [(NOTE, text, True) for text in result.notices]
    return [line for line in lines if line[1] and not line[1].startswith("nan")]


def method_label(name: str) -> str:
    """Return the short label of a method, such as "Moreau-Jean"."""
    return METHOD_NAMES.get(name, name).partition(" (")[0]


def method(result: Any) -> str:
    """Return the method, its step size and the reason for this choice."""
    name, step = str(result.header.get("method")), result.header.get("step")
    size = f", {1e3 * step:.3g} ms" if isinstance(step, float) else ""
    reason = str(result.header.get("why", "")).partition(": ")[2]
    return f"{method_label(name)}{size}{': ' * bool(reason)}{reason}"


def _accuracy(run: Run) -> str:
    """Return the error estimate as lengths and angles, and relative to the motion."""
    if math.isinf(float(run.result.error_estimate)):
        return f"known {_until(run.result)} only"
    return ": ".join(filter(None, (felt(run), run.result.accuracy.partition(", ")[2])))


def why(run: Run, error: float) -> str:
    """Return advice for a large error or drift, or "" if it is small."""
    better = remedy(run)
    if better is None or not error >= POOR:
        return ""
    return f"; a smaller {'step' if better[1] == 'step' else 'tolerance'} makes it smaller"


def cost(result: Any) -> str:
    """Return the cost of a run, such as '12.3 ms: 250 steps, built in 2 ms'.

    It leaves out the time in which kernels are loaded, once in a program.
    """
    counters = dict(result.counters).items()
    counts = [f"{int(n)} {WORDS.get(name, name.replace('_', ' '))}" for name, n in counters if n]
    timing = {name: float(s) for name, s in dict(result.timing).items()}
    took = _duration(timing.get("step", 0.0) + timing.get("estimate", 0.0))
    built = f"built in {_duration(timing['build'])}" if "build" in timing else ""
    return ": ".join(filter(None, (took, ", ".join(filter(None, (*counts, built))))))


def _duration(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
