"""A frame of playback in the page's server: processor time and bytes to one page.

From the tick of the clock to the messages queued, in models of which every body moves.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

import pgraph_core as pg

from .measure import Effort, Row, compared

MINUTES = 0.5
ME = 1  # the page


def rows(effort: Effort) -> Iterator[Row]:
    import viser

    from pgraph_app.core.bridge import quiet

    for n in effort.pick((16, 100, 1000), (4,)):
        with quiet():
            server = viser.ViserServer(port=0, verbose=False)
        yield from playback(effort, n, server)
        with quiet():
            server.stop()


def playback(effort: Effort, n: int, server: Any) -> Iterator[Row]:
    """Frames of a chain of n rods."""
    from pgraph_app.features import update
    from pgraph_app.playback import Scrub
    from pgraph_app.scene.view import SceneView

    state, sent = moving(n), [0, 0]
    page = SimpleNamespace(server=server, send=lambda *_: None)
    view = SceneView(page, lambda event: None)
    view.render(state, state)
    counted(server, sent)
    times = iter(np.tile(np.linspace(0.001, 0.099, 200), 100_000))

    def frame() -> None:
        nonlocal state
        after = update(state, Scrub(ME, float(next(times))))
        view.render(state, after)
        state, sent[1] = after, sent[1] + 1

    (row,) = compared(effort, f"{n} bodies", {"pgraph": frame}, unit="frame")
    yield {**row, "agrees": f"{sent[0] / sent[1]:.0f} bytes"}


def moving(n: int) -> Any:
    """The page's state with a run in which all bodies move."""
    from pgraph_app.core.jobs import Done
    from pgraph_app.features import initial, update
    from pgraph_app.gait import Simulate
    from pgraph_app.scene import Show, Viewport
    from pgraph_app.session import Connected

    model = pg.Model.serial(n)
    result = pg.simulate(pg.Mechanism(model), t_end=0.1, step=1e-3, method="rk4")
    state = initial(model)
    for event in (
        Connected(ME), Viewport(ME, 1.0), Simulate(ME), Done(1, result),
        Show(ME, "axes", False),
    ):  # fmt: skip
        state = update(state, event)
    return state


def counted(server: Any, sent: list[int]) -> None:
    """Add up the bytes of every message that the server queues from now on, packed as sent."""
    import msgspec

    socket = server._websock_server
    queue = socket.queue_message

    def queue_message(message: Any) -> None:
        sent[0] += len(msgspec.msgpack.encode(message.as_serializable_dict()))
        queue(message)

    socket.queue_message = queue_message
