"""Hooks that lower layers require from higher layers. `pgraph_core/__init__.py`, above all layers,
sets them.
"""

from collections.abc import Callable, Mapping
from typing import Any

page: Callable[..., str]  # (run, fields that stay open, live) -> the HTML of a figure
elsewhere: Callable[[], Mapping[str, str]]  # public name -> what stands before it: "run.", "pg."
bound: Callable[[Any, str], Any]  # (model or mechanism, name) -> what takes it first, or None
passed: Callable[[str], bool]  # name of an argument -> whether simulate takes it
edited: Callable[..., Any]  # (model, path or {path: number}, (number,), fields) -> the new model
taken: Callable[
    ..., str
]  # (name of a field or an argument, arguments of its call) -> what takes it
