"""The cost of a frame of playback to the page's server: `python -m benchmarks.frames`.

Milliseconds in the thread that owns the state, from the clock's tick to the messages queued, and
bytes sent to one page, for models of 16, 100 and 1000 bodies of which every one moves.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import msgspec
import numpy as np
import viser

import pgraph_core as pg
from pgraph_app.core.bridge import quiet
from pgraph_app.core.state import State, initial
from pgraph_app.features import update
from pgraph_app.playback.update import Scrub
from pgraph_app.run.update import Simulate, Simulated
from pgraph_app.scene.update import Show, Viewport
from pgraph_app.scene.view import SceneView
from pgraph_app.session.update import Connected

FRAMES = 200
BODIES = (16, 100, 1000)
ME = 1


def moving(n: int) -> State:
    """A chain of n rods with a run in which all of them move."""
    model = pg.Model.serial(n)
    result = pg.simulate(pg.Mechanism(model), t_end=0.1, step=1e-3, method="rk4")
    state = update(update(initial(model), Connected(ME)), Viewport(ME, 1.0))
    state = update(state, Simulate(ME))
    state = update(state, Simulated(1, result))
    return update(state, Show(ME, "axes", False))


def frames(n: int, server: viser.ViserServer) -> tuple[list[float], float]:
    """Milliseconds of each frame, and the mean of their bytes."""
    state, sent = moving(n), [0]
    view = SceneView(server, lambda event: None)
    view.render(state, state)
    counted(server, sent)
    taken = []
    for time_shown in np.linspace(0.001, 0.099, FRAMES):
        start = time.perf_counter()
        after = update(state, Scrub(ME, float(time_shown)))
        view.render(state, after)
        taken.append(1e3 * (time.perf_counter() - start))
        state = after
    return taken, sent[0] / FRAMES


def counted(server: viser.ViserServer, sent: list[int]) -> None:
    """Add up the bytes of every message that the server queues from now on, packed as sent."""
    socket = server._websock_server
    queue = socket.queue_message

    def queue_message(message: Any) -> None:
        sent[0] += len(msgspec.msgpack.encode(message.as_serializable_dict()))
        queue(message)

    socket.queue_message = queue_message  # type: ignore[method-assign]


def main() -> None:
    """A line a size: median and 95th percentile [ms], bytes a frame."""
    print("bodies   median ms   95 % ms   bytes a frame")
    for n in BODIES:
        with quiet():
            server = viser.ViserServer(port=18400, verbose=False)
        taken, size = frames(n, server)
        slow = statistics.quantiles(taken, n=20)[-1]
        print(f"{n:6d}   {statistics.median(taken):9.2f}   {slow:7.2f}   {size:13.0f}")
        with quiet():
            server.stop()


if __name__ == "__main__":
    main()
