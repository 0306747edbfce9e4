"""Packages that only some functions need: imported on use, with the extra to install if missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import PgraphError, Problem


class MissingPackage(PgraphError, ImportError):
    """An optional package is not installed; the text names the command that installs it."""


def needed(module: str, extra: str) -> Any:
    """The imported `module`. Raises MissingPackage naming the `extra` of pgraph-dynamics."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        text = f"is not installed; type: pip install 'pgraph-dynamics[{extra}]'"
        raise MissingPackage(Problem(f"package '{package}'", "", text)) from error
