"""What kill -9, junk and floods cost: `python -m benchmarks.reliability`, printed as a table.

A client speaks the page's own protocol over a websocket: it edits masses, waits for the answers,
and the server is killed at a random instant. The next server with the same model must have the
last edit that was acknowledged, or a later one that was sent.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import pgraph_core as pg
from benchmarks.machine import machine

SUBPROTOCOL: Any = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 3.0),
    "fov": 1.0, "near": 0.01, "far": 1000.0, "image_height": 400, "image_width": 600,
    "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip
TOPIC = re.compile(r"\.push\((\[.*?\])\); window\.pgraph", re.DOTALL)
BODIES = 16


class Client:
    """One page without a browser: it sends events and keeps the answers to its cells."""

    def __init__(self, url: str):
        at = url.split("//")[1].split("/")[0]
        self.socket = connect(f"ws://{at}", subprotocols=[SUBPROTOCOL], max_size=None)
        self.answered: dict[int, str] = {}  # serial -> "" where it was taken
        self._uplink, self._closed = "", False
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()
        self.socket.send(msgspec.msgpack.encode(CAMERA))
        with self._changed:
            assert self._changed.wait_for(lambda: self._uplink, 30), "the server said nothing"

    def send(self, event: str, **fields: Any) -> None:
        """An event of the page, by its class name."""
        value = json.dumps({"event": event, **fields})
        update = {"type": "GuiUpdateMessage", "uuid": self._uplink, "updates": {"value": value}}
        self.socket.send(msgspec.msgpack.encode(update))

    def answer(self, serial: int, seconds: float = 30.0) -> str:
        """The reply to a cell. Raises TimeoutError."""
        with self._changed:
            self._changed.wait_for(lambda: serial in self.answered or self._closed, seconds)
            if serial not in self.answered:
                raise TimeoutError(f"no answer to {serial} within {seconds} s")
            return self.answered[serial]

    def _read(self) -> None:
        unpack = zstandard.ZstdDecompressor()
        with contextlib.suppress(ConnectionClosed, OSError):
            for raw in self.socket:
                size = int.from_bytes(raw[:8], "little")  # type: ignore[arg-type]
                packed = int.from_bytes(raw[8:16], "little")  # type: ignore[arg-type]
                inner = unpack.decompress(raw[16 : 16 + packed], max_output_size=size)  # type: ignore[arg-type]
                for message in msgspec.msgpack.decode(inner)["messages"]:
                    if message["type"] == "RunJavascriptMessage":
                        self._heard(message["source"])
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _heard(self, source: str) -> None:
        for text in TOPIC.findall(source):
            topic, data = json.loads(text)
            with self._changed:
                if topic == "uplink":
                    self._uplink = data
                elif topic == "reply":
                    self.answered[data["serial"]] = data["text"]
                self._changed.notify_all()


@contextlib.contextmanager
def server(state: Path, model: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server in a process of its own, and its address."""
    command = [sys.executable, "-m", "app", str(model), "--port", "18765", "--no-browser"]
    environment = {**os.environ, "XDG_STATE_HOME": str(state)}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    )
    assert process.stdout is not None
    try:
        for line in process.stdout:
            if "Pgraph is at" in line:
                assert ":18765/" in line, f"the port was not free: {line}"
                yield process, line.split()[-1]
                return
        raise RuntimeError("the server ended before it served")
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def recovered(state: Path) -> list[float]:
    """The masses in the one file that a session left; raises if it is damaged."""
    (file,) = (state / "pgraph").glob("*.json")
    model = pg.Model.from_json(json.loads(file.read_text("utf-8"))["text"])
    return [body.mass for body in model.bodies]


def kill_once(rng: random.Random, folder: Path) -> tuple[int, int]:
    """(edits acknowledged, edits lost) of a server that is killed among edits."""
    state, file = folder / "state", folder / "model.json"
    pg.Model.serial(BODIES).save(file)
    sent: dict[int, tuple[int, float]] = {}  # serial -> (body, mass)
    with server(state, file) as (process, url):
        client = Client(url)
        doomed = threading.Timer(rng.uniform(0.1, 2.0), process.send_signal, [signal.SIGKILL])
        doomed.start()
        with contextlib.suppress(ConnectionClosed, OSError, TimeoutError):
            for serial in range(1, 10_000):
                body = rng.randrange(BODIES)
                sent[serial] = body, float(serial)
                client.send(
                    "Edit", serial=serial, body=str(body + 1), field="mass", index=[],
                    text=str(serial),
                )  # fmt: skip
                if rng.random() < 0.7:
                    client.answer(serial, 3.0)
        doomed.join()
        process.wait()
    taken = [serial for serial, text in client.answered.items() if not text]
    if not taken:
        return 0, 0
    masses, last = recovered(state), {}
    for serial in taken:
        last[sent[serial][0]] = serial
    lost = sum(masses[body] < serial for body, serial in last.items())
    return len(taken), lost


def kills(count: int) -> str:
    """A row: servers killed among edits, edits acknowledged and lost."""
    rng, acknowledged, lost = random.Random(1), 0, 0
    for _ in range(count):
        with tempfile.TemporaryDirectory() as folder:
            a, b = kill_once(rng, Path(folder))
            acknowledged, lost = acknowledged + a, lost + b
    return (
        f"| kill -9 among edits | {count} kills, {acknowledged} edits acknowledged | "
        f"{lost} lost, 0 damaged files, port free each time |"
    )


def flood(seconds: float) -> str:
    """A row: the delay of one page's edits, alone and while another floods."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "model.json")
        pg.Model.serial(BODIES).save(file)
        with server(Path(folder, "state"), file) as (_, url):
            time.sleep(5.0)  # the kernels load meanwhile
            honest, hostile = Client(url), Client(url)
            alone = delays(honest, 1, seconds)
            stop = threading.Event()

            def shout() -> None:
                while not stop.is_set():
                    hostile.send("Select", body="1")

            thread = threading.Thread(target=shout, daemon=True)
            thread.start()
            meanwhile = delays(honest, 10**6, seconds)
            stop.set()
            hostile.socket.close()
    return (
        f"| one page floods | edits of another page: {len(alone)} alone, "
        f"{len(meanwhile)} meanwhile | "
        f"median {1e3 * statistics.median(alone):.0f} ms alone, "
        f"{1e3 * statistics.median(meanwhile):.0f} ms meanwhile |"
    )


def delays(client: Client, first: int, seconds: float) -> list[float]:
    """Seconds from an edit to its answer, one after the other."""
    found, end, serial = [], time.perf_counter() + seconds, first
    while time.perf_counter() < end:
        serial += 1
        sent = time.perf_counter()
        client.send("Edit", serial=serial, body="2", field="mass", index=[], text=str(serial))
        assert client.answer(serial) == ""
        found.append(time.perf_counter() - sent)
        time.sleep(0.02)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    args = parser.parse_args()
    print(f"Measured on {machine()}.\n")
    print("| What happens | How often | What was lost |\n|---|---|---|")
    print(kills(args.kills), flush=True)
    print(flood(5.0), flush=True)


if __name__ == "__main__":
    main()
