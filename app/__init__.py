"""Pgraph in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pgraph_core as pg

    from .server import Server


def show(model: pg.Model) -> Server:
    """Open `model` in the browser; the page lives as long as the returned server."""
    from .server import serve

    return serve(model)
