"""Sessions that are killed at random moments: `python -m tests.app.kills FOLDER KILLS SEED`.

Processes that edit models through the store's update functions and Autosave, as servers do, are
forked and killed by SIGKILL. Each says in a pipe which model it is about to make and which it has
acknowledged. No acknowledged model may be lost: each must be in a file, and be offered once all
processes are dead. Two models in two folders are edited by up to two processes at a time.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import pgraph_core as pg
from pgraph_app.features import initial, update
from pgraph_app.model import OpenKept, Redo, Undo, recovered
from pgraph_app.session.autosave import Autosave, left_behind

from .store import ME, do

AS_STARTED = 1.0  # number of a model without edits
LONGEST = 0.03  # [s] longest life of a process after its first edit


def numbered(model: pg.Model) -> float:
    """Return the number of a model, which each edit changes: the mass of its first body."""
    return model.bodies[0].mass


def found(folder: Path) -> set[float]:
    """Return the numbers of the models that are offered."""
    texts = [json.loads(kept.text) for kept in left_behind(folder)]
    return {text["bodies"][0].get("mass", AS_STARTED) for text in texts}


def session(folder: Path, given: str, seed: int, pipe: int) -> None:
    """Edit until killed. Writes `b OLD NEW` before an edit and `a OLD NEW` after it."""
    chance = random.Random(seed)
    left = left_behind(folder)
    state = recovered(initial(pg.Model.serial(2 + given.count("b"))), left, given)
    again = {kept.path for kept in left} - {kept.path for kept in state.kept.values()}
    keeper = Autosave(folder, given, lambda event: None, again)
    keeper.render(state, state)
    state, number = update(state, do.Connected(ME)), 1.0 + seed
    while True:
        number += 2.0**-20
        events = [
            do.EditBodies(ME, 1, (state.model.bodies[0].name,), "mass", (((), repr(number)),))
        ]
        if chance.random() < 0.2 and state.kept:
            events = [OpenKept(ME, chance.choice(list(state.kept)))]
        elif chance.random() < 0.1:
            events = [Undo(ME), Redo(ME)]
        for event in events:
            old, state = state, update(state, event)
            said = f" {numbered(old.model)!r} {numbered(state.model)!r}\n".encode()
            said *= state.document == old.document  # else both models stay
            os.write(pipe, b"b" * bool(said) + said)
            keeper.render(old, state)
            os.write(pipe, b"a" * bool(said) + said)


class Killed:
    """One process."""

    def __init__(self, folder: Path, given: str, seed: int):
        self.given, (self.pipe, end) = given, os.pipe()
        self.id = os.fork()
        if self.id == 0:
            try:
                session(folder, given, seed, end)
            finally:
                os._exit(1)
        os.close(end)
        self.said = b""
        while b"\n" not in self.said:  # its first edit
            self.said += os.read(self.pipe, 1 << 16)

    def kill(self) -> list[tuple[str, float, float]]:
        """Kill the process and return its messages: (b or a, number before, number after)."""
        os.kill(self.id, signal.SIGKILL)
        _, status = os.waitpid(self.id, 0)
        assert os.WIFSIGNALED(status), "a session ended by itself"
        while part := os.read(self.pipe, 1 << 20):
            self.said += part
        os.close(self.pipe)
        lines = [line.split() for line in self.said.decode().splitlines()]
        return [(kind, float(old), float(new)) for kind, old, new in lines]


def main(folder: Path, kills: int, seed: int) -> None:
    chance = random.Random(seed)
    tips: set[float] = set()  # acknowledged models that nobody has edited further
    running: list[Killed] = []
    for k in range(kills):
        while len(running) < chance.choice((1, 2)):
            given = str(folder / chance.choice(("x", "y")) / chance.choice(("a.json", "b.json")))
            running.append(Killed(folder, given, 1000 * (k + 1) + len(running)))
        time.sleep(chance.uniform(0.0, LONGEST))
        one = running.pop(chance.randrange(len(running)))
        said = one.kill()
        done = [(old, new) for kind, old, new in said if kind == "a"]
        for old, new in done:
            tips.discard(old)
            tips.add(new)
        offered = found(folder)
        # an edit under way may be written; one that is taken back leaves no file
        if said[-1][0] == "b" and said[-1][2] in {*offered, AS_STARTED}:
            tips.discard(said[-1][1])
            tips.add(said[-1][2])
        tips.discard(AS_STARTED)
        if not running:
            assert tips <= offered, f"kill {k}: lost {tips - offered}"
    for one in running:
        said = one.kill()
        for kind, old, new in said:
            tips.discard(old)
            if kind == "a":
                tips.add(new)
    offered = found(folder)
    lost = tips - offered - {AS_STARTED}
    assert not lost, f"lost {lost}"
    assert not list(folder.glob("*.new"))
    print(len(tips))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
