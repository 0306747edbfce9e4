"""All features: each folder of the app that has an `update.py` is one."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from .core.events import update as update

APP = Path(__file__).parent
FEATURES = tuple(sorted(path.parent.name for path in APP.glob("*/update.py")))

for _name in FEATURES:
    import_module(f".{_name}.update", __package__)
