"""Discovery of features: each folder in the app with an `update.py` is one."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from .core.events import update as update

if TYPE_CHECKING:
    from .core.views import Place

APP = Path(__file__).parent
FEATURES = tuple(sorted(path.parent.name for path in APP.glob("*/update.py")))

for _name in FEATURES:
    import_module(f".{_name}.update", __package__)


def places() -> list[Place]:
    """Collect the views of all features, `VIEWS` in each `view.py`."""
    names = sorted(path.parent.name for path in APP.glob("*/view.py"))
    return [place for name in names for place in import_module(f".{name}.view", __package__).VIEWS]
