"""What lower floors ask of higher ones. `pgraph_core/__init__.py`, above all floors, gives it."""

from collections.abc import Callable

page: Callable[..., str]  # (run, fields that stay open) -> the HTML of a living figure
