"""The model itself: new, open, save, undo, redo, and derived data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pgraph_core as pg


@dataclass(frozen=True)
class Step:
    """A user action as an undo step, with the model before it and a description."""

    model: pg.Model
    label: str
    rows: Any = None  # the Rows of that model
    document: int = 0  # `State.document` of that model


@dataclass(frozen=True)
class Found:
    """The result of an errand: changes to bodies, or a whole model, and a message."""

    text: str = ""
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # body -> fields
    opened: pg.Model | None = None
    report: pg.Report | None = None  # report on a file of another format
    members: tuple[str, ...] = ()  # models of an archive, one of which is to be chosen


@dataclass(frozen=True)
class Members:
    """The models in an archive, from which a page chooses one."""

    file: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Errand:
    """Background work with a result that may change bodies of `model`.

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
