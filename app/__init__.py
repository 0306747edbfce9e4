"""Pgraph in the browser. This folder is installed as the package `pgraph_app`."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pgraph_core as pg
    from pgraph_app.server import Server


def show(model: pg.Model) -> Server:
    """Open `model` in the browser. The page stays available while the returned server exists."""
    from pgraph_app.server import serve  # even if this package is called `app`

    return serve(model)
