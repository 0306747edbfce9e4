"""Discovery of features: each folder in the app with a `view.py` is one.

What its `__init__.py` declares as `State` and `Client` becomes a part of the state and of a page,
its events are there or in `update.py`, and its `view.py` lists views in `VIEWS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import pgraph_core as pg

from .core.events import update as update
from .core.views import Place

APP = Path(__file__).parent
FEATURES = tuple(sorted(path.parent.name for path in APP.glob("*/view.py")))
FOLDERS = [import_module(f".{name}", __package__) for name in FEATURES]

for _path in APP.glob("*/update.py"):
    import_module(f".{_path.parent.name}.update", __package__)


def composed(name: str, **constants: Any) -> type:
    """Return the class that has the fields and methods of that class in each feature."""
    found = list(dict.fromkeys(getattr(folder, name) for folder in FOLDERS))
    ends = [one for one in found if not any(one in other.__mro__[1:] for other in found)]
    return dataclass(frozen=True)(type(name, tuple(ends), constants))


Client = composed("Client")
State = composed("State", CLIENT=Client)


def initial(model: pg.Model, gallery: Mapping[str, str] | None = None) -> Any:
    """Return the initial state of the server, whose gallery has built-in models as JSON text."""
    state = State(model, gallery=gallery or {})
    return state.opened(state)


def places() -> list[Place]:
    """Collect the views of all features, `VIEWS` in each `view.py`."""
    views = [import_module(f".{name}.view", __package__) for name in FEATURES]
    return [place for view in views for place in view.VIEWS]
