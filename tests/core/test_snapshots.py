"""Forged snapshots, whose digest is right: refused, or a state from which steps go on."""

import os
import signal
from hashlib import sha256

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.portable import SUM

PATIENCE = 60  # [s] for one forged snapshot; only reached where it hangs
FORGED = (2**62, -1, -(2**63), 7, *np.array([-3.5, 1e300, np.nan]).view(np.int64).tolist())


def forged(snapshot, kind, place, value):
    """Return the snapshot with another word, and the digest of what it then holds."""
    start = len(f"pgraph {kind} ") + SUM
    rest = bytearray(snapshot[start:])
    rest[place : place + 8] = int(value).to_bytes(8, "little", signed=True)
    return snapshot[: start - SUM] + sha256(rest).digest()[:SUM] + bytes(rest)


def words(snapshot, kind):
    """Return the places of the words of the state."""
    start = len(f"pgraph {kind} ") + SUM
    head = 4 + int.from_bytes(snapshot[start : start + 4], "little")
    return range(head, len(snapshot) - start, 8)


def try_all(make, most):
    """Restore and step with each of at most `most` words forged. Return the number refused."""
    stepper = make()
    kind = type(stepper).__name__
    stepper.step(n=40)
    snapshot, refused = stepper.save(), 0
    places = words(snapshot, kind)
    for place in places[:: max(1, len(places) // most)]:
        for value in FORGED:
            signal.alarm(PATIENCE)
            try:
                stepper.restore(forged(snapshot, kind, place, value))
                stepper.step(n=2)
            except pg.PgraphError:
                refused += 1
    stepper.restore(snapshot)
    return refused


def model(name):
    return pg.Model.load(pgraph_models.path(name))


SCENES = {
    "chain": lambda: pg.Stepper(pg.Model.serial(2)),
    "gauss": lambda: pg.Stepper(pg.Model.serial(2), method="gauss6"),
    "gauss loop": lambda: pg.Stepper(model("four_bar"), method="gauss6"),
    "loop": lambda: pg.Stepper(model("slider_crank")),
    "contact": lambda: pg.Stepper(model("falling_rod")),
    "walk": lambda: pg.Stepper(model("quadruped"), scenario="bound", switches=()),
    "lanes": lambda: pg.BatchStepper(pg.Model.serial(2), 3),
    "batch": lambda: pg.BatchStepper(model("falling_rod"), 2),
}


@pytest.mark.parametrize(
    ("scene", "most"),
    [
        *((scene, 60) for scene in SCENES),
        *(pytest.param(scene, 2000, marks=pytest.mark.nightly) for scene in SCENES),
    ],
)
def test_no_forged_word_ends_or_hangs_the_process(scene, most):
    child = os.fork()  # a fault would end this process
    if child == 0:
        done = 1
        try:
            done = 0 if try_all(SCENES[scene], most) else 2
        finally:
            os._exit(done)
    assert os.waitpid(child, 0)[1] == 0


@pytest.mark.parametrize("words", [b"x", b"1", b"-1", b"9", b"0,0,7", b"\xff"])
def test_a_forged_list_of_active_constraints_is_refused(words):
    stepper = pg.Stepper(model("four_bar"))
    before = stepper.save()
    start = len(b"pgraph Stepper ") + SUM
    size = int.from_bytes(before[start : start + 4], "little")
    head, body = before[start + 4 : start + 4 + size], before[start + 4 + size :]
    version, key, _ = head.split(b"\n")
    head = b"\n".join((version, key, words))
    rest = len(head).to_bytes(4, "little") + head + body
    with pytest.raises(pg.InputError, match="snapshot"):
        stepper.restore(b"pgraph Stepper " + sha256(rest).digest()[:SUM] + rest)
    assert stepper.save() == before
