"""What the user typed, as values."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import pgraph_core as pg
import pgraph_models
from pgraph_core.errors import InputError, Problem, choices

LARGEST = 100_000  # bodies of a new model: more is a slip of the finger


def model(name: str) -> pg.Model:
    """The model in a file, or the built-in one of this name. Raises PgraphError."""
    return pg.Model.load(model_path(name))


def model_path(name: str) -> Path:
    """A built-in name stands for its model; write ./name for a file that is called the same."""
    if name in pgraph_models.names():
        return pgraph_models.path(name)
    path = Path(name)
    if path.exists() or path.suffix or os.sep in name:
        return path
    known = choices(pgraph_models.names(), 40)
    text = f"is neither a file nor a built-in model; the built-in models are {known}"
    raise InputError(Problem(f"model '{name}'", "", text))


def body_count(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if not 1 <= count <= LARGEST:
        raise argparse.ArgumentTypeError(
            f"must be a whole number from 1 to {LARGEST}; given {text!r}"
        )
    return count


def port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f"must be a whole number from 0 (any free port) to 65535; given {text!r}"
        )
    return int(text)


def duration(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a finite number > 0; given {text!r}")
    return value


def tolerance(text: str) -> float:
    value = duration(text)
    if value > 0.1:
        raise argparse.ArgumentTypeError(f"must be at most 0.1; given {text!r}")
    return value
