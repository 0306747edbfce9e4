"""The model itself: new, open, save, undo, redo, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pgraph_core as pg


@dataclass(frozen=True)
class Step:
    """One user action, as an undo step: the model before it and what the action was."""

    model: pg.Model
    label: str
    rows: Any = None  # the Rows of that model
    document: int = 0  # `State.document` of that model


@dataclass(frozen=True)
class Found:
    """The answer to an errand: changes of bodies, or a whole model, and a sentence."""

    text: str = ""
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # body -> fields
    opened: pg.Model | None = None
    report: pg.Report | None = None  # report on a file of another format
    members: tuple[str, ...] = ()  # models of an archive, one of which is to be chosen


@dataclass(frozen=True)
class Members:
    """The models of an archive, for a page to choose one."""

    file: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Errand:
    """Background work whose answer may change bodies of `model`.

    It runs in a thread, or `apart` in a child process, to which `work` is sent without a model.
    """

    id: int
    client: int
    model: pg.Model
    label: str
    work: Callable[[pg.Model], Found]  # raises PgraphError, Refusal, OSError
    compiled: bool = False  # waits until the kernels are compiled
    file: str = ""  # name of the model file that is read
    apart: bool = False
    leaves: Path | None = None  # a folder that `work` makes
