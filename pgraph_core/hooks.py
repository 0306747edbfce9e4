"""Hooks that lower layers require from higher layers. `pgraph_core/__init__.py`, above all layers,
sets them.
"""

from collections.abc import Callable

page: Callable[..., str]  # (run, fields that stay open) -> the HTML of a living figure
