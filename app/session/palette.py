"""The palette of commands, Ctrl+K: viser's own, which tells our page what to do."""

from __future__ import annotations

from typing import Any

from ..core.bridge import Bridge
from ..core.state import State

COMMANDS: tuple[tuple[str, str, str], ...] = (  # what the page runs, its name, its keys or use
    ("new", "New model", "how many bodies, or from a built-in one"),
    ("open", "Open a model", "Ctrl+O"),
    ("save", "Save the model", "Ctrl+S"),
    ("download", "Download the model", "as one file"),
    ("undo", "Undo", "Ctrl+Z"),
    ("redo", "Redo", "Ctrl+Shift+Z"),
    ("find", "Find a body", "Ctrl+F"),
    ("add", "Add a body", "Ctrl+Enter"),
    ("simulate", "Simulate", "runs in the background, then plays"),
    ("live", "Live", "plays while it computes"),
    ("play", "Play or pause", "Space"),
    ("view:fit", "Fit view", "F"),
    ("view:front", "View from front", "1"),
    ("view:side", "View from the side", "2"),
    ("view:top", "View from the top", "3"),
    ("view:isometric", "Isometric view", "0"),
    ("theme", "Dark or light", "the theme of this page"),
    ("tab:Digraph", "Show the digraph", "the tree of bodies"),
    ("tab:Constraints", "Show constraints", "loops, contacts, forces"),
    ("tab:Operators", "Show operators", "mass matrix, Jacobian"),
    ("tab:Plots", "Show plots", "quantities over time"),
    ("tab:Report", "Show the report", "error against run time, stability"),
    ("tab:Properties", "Show properties", "of the selected body"),
    ("tab:Pose", "Show the pose", "sliders of the joints"),
    ("tab:Show", "What is drawn in 3D", "axes, names, forces"),
    ("tab:Gait", "Show the gait", "walk and steer"),
    ("tour", "Take the tour", "five steps"),
    ("keys", "Help and keys", "?"),
)


class PaletteView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        for run, label, description in COMMANDS:
            command = bridge.server.gui.add_command(label, description=description)

            @command.on_trigger
            async def _(event: Any, run: str = run) -> None:
                if event.client is not None:
                    bridge.send(event.client.client_id, "command", {"run": run})

    def render(self, old: State, new: State) -> None:
        """Commands are the same for every model."""
