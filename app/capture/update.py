"""Events of motion capture: a trial that is opened, matched, fitted and scaled (pure)."""

from __future__ import annotations

import base64
import binascii
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from pydantic import Field

import pgraph_core as pg

from ..core.cells import Refusal, named_number
from ..core.edit import attempted
from ..core.events import FromPage, Text, TypedText
from ..core.jobs import started
from ..core.state import Notice, told
from ..model import ErrandDone, Found, sent
from . import (
    NEAREST,
    NOT_USED,
    Dynamics,
    File,
    Fit,
    Reading,
    State,
    Take,
    proposed,
    scaled,
    shown,
)

# -- the trial ------------------------------------------------------------------------------------


class OpenTrial(FromPage):
    """Open a file of motion capture. One with force plates alone completes one with markers."""

    name: Text
    content: Annotated[str, Field(max_length=16_000_000)]  # base64

    def applied(self, state: State) -> State:
        try:
            content = base64.b64decode(self.content, validate=True)
        except (binascii.Error, ValueError):
            text = "The file did not arrive complete; try again."
            return told(state, self.client, Notice("Not done", text, bad=True))
        known = state.take.files if state.take is not None else ()
        reading = state.take.reading if state.take is not None else Reading()
        work = partial(_completed, known, (Path(self.name).name, content), reading)
        return _read(state, self.client, self.name, work)


def _read(state: State, client: int, name: str, work: Any) -> State:
    """Read files in a child process, and show the trial."""

    def then(now: State, done: ErrandDone) -> State:
        if done.problem:
            return told(now, client, Notice(f"{name} was not opened", done.problem, bad=True))
        files, trial, reading = done.found.value
        take = now.take or Take(files, trial)
        gone = files[0] != take.files[0] or reading != take.reading
        labels = {s: x for s, x in take.labels.items() if x in (NOT_USED, *trial.markers)}
        take = replace(take, files=files, trial=trial, reading=reading, labels=labels)
        now = replace(now, take=take)
        if gone:
            now = replace(now, fitting=None, fitted=None, fit_problem="")
        now = replace(now, computing=None, loads=None, moments_problem="")
        return shown(now)

    return sent(state, client, f"open {name}", work, file=name, apart=True, then=then)


def _completed(known: tuple[File, ...], new: File, how: Reading, _: Any) -> Found:
    """Read a file, with an earlier one if one has the markers and the other the plates. Raises
    Refusal."""
    trial = _trial((new,), how)
    for old in known:
        other = _trial((old,), how)
        for a, b, files in ((other, trial, (old, new)), (trial, other, (new, old))):
            moves = a.markers or a.coordinates
            if moves and not a.plates and b.plates and not b.markers:
                return Found(value=(files, _trial(files, how), how))
    return Found(value=((new,), trial, how))


def _trial(files: tuple[File, ...], how: Reading) -> pg.Trial:
    """Read the trial of files in memory. Raises Refusal."""
    with TemporaryDirectory() as folder:
        paths = [Path(folder, f"{k}{Path(name).suffix}") for k, (name, _) in enumerate(files)]
        for path, (_, content) in zip(paths, files):
            path.write_bytes(content)
        try:
            trial = pg.read_trial(
                paths[0], forces=paths[1] if len(paths) > 1 else None, up=how.up or None,
                units=how.units or None, subject=how.subject or None,
            )  # fmt: skip
        except pg.FileError as error:
            raise Refusal(error.problems[0].text) from None
    return replace(trial, source=files[0][0])


def _of(state: State) -> Take:
    """Return the trial. Raises Refusal."""
    if state.take is None:
        raise Refusal("There is no trial: open one first.")
    return state.take


def _with(state: State, **changes: Any) -> State:
    return replace(state, take=replace(_of(state), **changes))


class SetReading(TypedText):
    """Change how the files are read."""

    field: Literal["up", "units", "subject"]
    text: Text

    def taken(self, state: State) -> State:
        take = _of(state)
        reading = replace(take.reading, **{self.field: self.text.strip()})

        return _read(state, self.client, take.files[0][0], partial(_again, take.files, reading))


def _again(files: tuple[File, ...], how: Reading, _: Any) -> Found:
    return Found(value=(files, _trial(files, how), how))


class ShowTrial(FromPage):
    """Play the trial again, after a run."""

    def applied(self, state: State) -> State:
        return state if state.take is None or state.live is not None else shown(state)


class CloseTrial(FromPage):
    def applied(self, state: State) -> State:
        if state.take is None:
            return state
        gone = {"fitting": None, "fitted": None, "computing": None, "loads": None}
        return replace(state, take=None, beside=None, fit_problem="", moments_problem="",
                       scaled=None, **gone)  # fmt: skip


# -- the fit --------------------------------------------------------------------------------------


class MatchMarker(TypedText):
    """Choose the marker of a site, "" for none."""

    site: Text
    text: Text

    def taken(self, state: State) -> State:
        take = _of(state)
        if self.text not in (NOT_USED, *take.trial.markers):
            raise Refusal(f"The trial has no marker {self.text!r}.")
        return _with(state, labels={**take.labels, self.site: self.text})


class WeighMarker(TypedText):
    """Set the weight of a site."""

    site: Text
    text: Text

    def taken(self, state: State) -> State:
        value = named_number("The weight", self.text) if self.text.strip() else 1.0
        if value < 0.0:
            raise Refusal(f"The weight must be 0 or more, got {value:g}.")
        return _with(state, weights={**_of(state).weights, self.site: value})


class SwitchCapture(FromPage):
    """Switch the smoothing of the fit, or the band of the moments."""

    what: Literal["smooth", "band"]
    on: bool

    def applied(self, state: State) -> State:
        return state if state.take is None else _with(state, **{self.what: self.on})


class FitPose(FromPage):
    """Find the motion that follows the markers, in the background."""

    def applied(self, state: State) -> State:
        if state.take is None or state.fitting is not None:
            return state
        return started(state, Fit, state.take)


class CancelFit(FromPage):
    def applied(self, state: State) -> State:
        if state.fitting is None:
            return state
        return replace(state, fitting=None, fit_problem="The fit was cancelled.")


# -- moments --------------------------------------------------------------------------------------


def _positive(what: str, unit: str, text: str) -> float | None:
    """Return a number above 0 that was typed, None for an empty text. Raises Refusal."""
    if not text.strip():
        return None
    value = named_number(what, text)
    if not value > 0.0:
        raise Refusal(f"{what} must be above 0 {unit}, got {value:g}.")
    return value


class SetCutoff(TypedText):
    """Change the cut-off of the filter [Hz], "" for the usual one."""

    text: Text

    def taken(self, state: State) -> State:
        return _with(state, cutoff=_positive("The cut-off", "Hz", self.text))


class SetPlate(TypedText):
    """Choose the body that a plate bears, the nearest one, or none."""

    plate: Text
    text: Text

    def taken(self, state: State) -> State:
        take = _of(state)
        if self.plate not in {p.name for p in take.trial.plates}:
            raise Refusal(f"The trial has no plate {self.plate!r}.")
        if self.text not in (NEAREST, NOT_USED, *state.model.row):
            raise Refusal(f"The model has no body {self.text!r}.")
        return _with(state, plates={**take.plates, self.plate: self.text})


class ComputeMoments(FromPage):
    """Compute the joint moments of the fit, in the background."""

    def applied(self, state: State) -> State:
        fitted = state.following
        if state.take is None or state.computing is not None or fitted is None:
            return state
        return started(state, Dynamics, fitted, state.take)


class CancelMoments(FromPage):
    def applied(self, state: State) -> State:
        if state.computing is None:
            return state
        text = "The computation of moments was cancelled."
        return replace(state, computing=None, moments_problem=text)


# -- scaling --------------------------------------------------------------------------------------

MOST_PAIRS = 200


class SetPair(TypedText):
    """Change a pair of sites that scales a body, or add one after the last. No body removes it."""

    row: int
    field: Literal["body", "one", "other"]
    text: Text

    def taken(self, state: State) -> State:
        pairs = [list(pair) for pair in _of(state).pairs]
        if self.row == len(pairs) < MOST_PAIRS:
            pairs.append(["", "", ""])
        if not 0 <= self.row < len(pairs):
            raise Refusal("There is no such pair any more.")
        pairs[self.row][("body", "one", "other").index(self.field)] = self.text
        kept: Any = tuple(tuple(pair) for pair in pairs if pair[0])
        return _with(state, pairs=kept)


class ProposePairs(FromPage):
    """Take the two sites of each body that are farthest apart."""

    def applied(self, state: State) -> State:
        if state.take is None:
            return state
        pairs = proposed(state.model, state.take)
        if not pairs:
            text = "No body has two sites with markers; choose sites of neighbours by hand."
            return told(state, self.client, Notice("Nothing proposed", text))
        return _with(state, pairs=pairs)


class SetMass(TypedText):
    """Set the mass of the person [kg], "" for that of the model."""

    text: Text

    def taken(self, state: State) -> State:
        return _with(state, mass=_positive("The mass", "kg", self.text))


class ScaleModel(FromPage):
    """Scale the model to the trial, as one undo step."""

    def applied(self, state: State) -> State:
        if state.take is None:
            return state
        client, take = self.client, state.take

        def work(model: pg.Model) -> Found:
            return Found(value=(model, *scaled(model, take)))

        def then(now: State, done: ErrandDone) -> State:
            if done.problem:
                return told(now, client, Notice("Not scaled", done.problem, bad=True))
            before, model, report = done.found.value
            if before is not now.model:
                text = "The model has changed. Try again."
                return told(now, client, Notice("Not scaled", text, bad=True))
            now = attempted(now, client, lambda: model, "scale to the trial")
            return replace(now, scaled=report) if now.model is model else now

        return sent(state, client, "scale", work, compiled=True, then=then)
