"""Pgraph in the browser. Installed, this folder is the package `pgraph_app`.

From the repository root `python -m app` works too: the name `app` then means the same modules.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pgraph_core as pg

    from .server import Server


def show(model: pg.Model) -> Server:
    """Open `model` in the browser. The page lives as long as the returned server."""
    from .server import serve

    return serve(model)


if __name__ == "app":
    sys.modules[__name__] = import_module("pgraph_app")
