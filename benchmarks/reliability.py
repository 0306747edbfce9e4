"""What kill -9, floods, many pages and long use cost: `python -m benchmarks.reliability`.

A client speaks the page's own protocol over a websocket: it edits masses, saves, runs, waits for
the answers, and the server is killed at a random instant. Its files must have the last edit that
was acknowledged, or a later one that was sent. Counts of several nights add up with `--add FILE`.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import gc
import json
import os
import random
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import viser._messages
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import pgraph_app.features  # noqa: F401 - it registers the events
import pgraph_core as pg
from benchmarks.machine import machine
from pgraph_app.core.events import page_events

SUBPROTOCOL: Any = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 3.0),
    "fov": 1.0, "near": 0.01, "far": 1000.0, "image_height": 400, "image_width": 600,
    "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip
TOPIC = re.compile(r"\.push\((\[.*?\])\); window\.pgraph", re.DOTALL)
BODIES = 16
PORT = 18765
FIRST = 1001  # no mass of the model: each edit changes it
MARK = "PGRAPH_MEASURED"  # in the environment of a server and its children


class Client:
    """One page without a browser: it sends events and keeps the answers to its cells."""

    def __init__(self, url: str):
        at = url.split("//")[1].split("/")[0]
        self.socket = connect(f"ws://{at}", subprotocols=[SUBPROTOCOL], max_size=None)
        self.answered: dict[int, str] = {}  # serial -> "" where it was taken
        self.uplink, self._closed = "", False
        self._wanted, self._heard_at = b"", 0.0
        self.deaf = False  # what comes is thrown away
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()
        self.socket.send(msgspec.msgpack.encode(CAMERA))
        with self._changed:
            assert self._changed.wait_for(lambda: self.uplink, 120), "the server said nothing"

    def send(self, event: str, **fields: Any) -> None:
        """An event of the page, by its class name."""
        value = json.dumps({"event": event, **fields})
        update = {"type": "GuiUpdateMessage", "uuid": self.uplink, "updates": {"value": value}}
        self.socket.send(msgspec.msgpack.encode(update))

    def answer(self, serial: int, seconds: float = 30.0) -> str:
        """The reply to a cell. Raises TimeoutError."""
        with self._changed:
            self._changed.wait_for(lambda: serial in self.answered or self._closed, seconds)
            if serial not in self.answered:
                raise TimeoutError(f"no answer to {serial} within {seconds} s")
            return self.answered[serial]

    def listen_for(self, text: str) -> None:
        """Note when this text next comes from the server."""
        with self._changed:
            self._wanted, self._heard_at = text.encode(), 0.0

    def heard_at(self, seconds: float) -> float:
        """When it came. Raises TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._heard_at, seconds):
                raise TimeoutError(f"{self._wanted!r} did not come within {seconds} s")
            return self._heard_at

    def _read(self) -> None:
        unpack = zstandard.ZstdDecompressor()
        with contextlib.suppress(ConnectionClosed, OSError):
            for raw in self.socket:
                if self.deaf:
                    continue
                size = int.from_bytes(raw[:8], "little")  # type: ignore[arg-type]
                packed = int.from_bytes(raw[8:16], "little")  # type: ignore[arg-type]
                inner = unpack.decompress(raw[16 : 16 + packed], max_output_size=size)  # type: ignore[arg-type]
                now = time.perf_counter()
                if self._wanted and self._wanted in inner:
                    with self._changed:
                        self._heard_at = self._heard_at or now
                        self._changed.notify_all()
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
                    self.uplink = data
                elif topic == "reply":
                    self.answered[data["serial"]] = data["text"]
                self._changed.notify_all()


@contextlib.contextmanager
def server(state: Path, model: Path, port: int = PORT) -> Iterator[tuple[Process, str]]:
    """A server in a process of its own, and its address."""
    command = [str(model), "--port", str(port), "--no-browser"]
    said = state.with_suffix(".said")
    said.write_text("")
    process = nursery().born(command, {"XDG_STATE_HOME": str(state), MARK: str(state)}, said)
    try:
        for _ in range(1200):
            if found := re.search(r"Pgraph is at (\S+)", said.read_text()):
                assert f":{port}/" in found[1], f"the port was not free: {found[1]}"
                yield process, found[1]
                return
            time.sleep(0.05)
        raise RuntimeError(f"the server does not serve: {said.read_text()}")
    finally:
        process.kill()


class Process:
    """A server that a nursery started."""

    def __init__(self, pid: int):
        self.pid = pid

    def kill(self) -> None:
        """Kill it, if it still lives, and wait for its end."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        self.wait()

    def wait(self) -> None:
        """Until the process has ended."""
        while Path(f"/proc/{self.pid}").exists():
            time.sleep(0.005)


class Nursery:
    """A process that has imported what a server needs, and forks one when told to."""

    def __init__(self) -> None:
        command = [sys.executable, "-c", "from benchmarks.reliability import fork; fork()"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def born(self, words: list[str], environment: dict[str, str], said: Path) -> Process:
        """A server with these words of the command line, which writes to the file `said`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([words, environment, str(said)]), file=self._process.stdin, flush=True)
        return Process(int(self._process.stdout.readline()))


nursery = functools.cache(Nursery)


def fork() -> None:
    """Start servers as the lines of the standard input say, until it ends."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `pgraph` sets it
    import pgraph_app.server  # noqa: F401 - nothing is left to import when a server is born
    from pgraph_app.cli import main as serve

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them: they leave no zombies
    for line in sys.stdin:
        words, environment, said = json.loads(line)
        if pid := os.fork():
            print(pid, flush=True)
            continue
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        out = os.open(said, os.O_WRONLY | os.O_APPEND)
        for stream in (1, 2):
            os.dup2(out, stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.environ.update(environment)
        os._exit(serve(words))


# -- kill -9 ---------------------------------------------------------------------------------------


def masses(text: str) -> list[float]:
    """The masses in a model file. Raises PgraphError if it is damaged."""
    return [body.mass for body in pg.Model.from_json(text).bodies]


def kill_once(rng: random.Random, folder: Path, port: int) -> Counter[str]:
    """Counts of a server that is killed among edits, saves and runs."""
    state, file, copy = folder / "state", folder / "model.json", folder / "copy.json"
    pg.Model.serial(BODIES).save(file)
    sent: dict[int, tuple[int, float]] = {}  # serial of an edit -> (body, mass)
    saves: dict[int, int] = {}  # serial of a save -> of the edit before it
    with server(state, file, port) as (process, url):
        client = Client(url)
        doomed = threading.Timer(rng.uniform(0.0, 0.1), process.kill)
        runs, last = 0, FIRST + rng.randint(0, 60)
        with contextlib.suppress(ConnectionClosed, OSError, TimeoutError):
            for serial in range(FIRST, FIRST + 10_000):
                if serial == last + 1:
                    doomed.start()
                chance = rng.random()
                if chance < 0.1:
                    client.send("Simulate")
                    runs += 1
                elif chance < 0.2:
                    saves[serial] = max(sent, default=0)
                    client.send("Save", serial=serial, path=str(copy), replace=True)
                    client.answer(serial, 10.0)
                else:
                    body = rng.randrange(BODIES)
                    sent[serial] = body, float(serial)
                    client.send(
                        "Edit", serial=serial, body=str(body + 1), field="mass", index=[],
                        text=str(serial),
                    )  # fmt: skip
                    if rng.random() < 0.7:
                        client.answer(serial, 10.0)
        if doomed.ident is None:  # an answer did not come in time
            doomed.start()
        doomed.join()
        process.wait()
        found = Counter(kills=1, runs=runs, port_taken=not _free(port))
    found["children_left"] = _left(str(state))
    taken = [serial for serial, text in client.answered.items() if not text]
    edits, saved = [s for s in taken if s in sent], [s for s in taken if s in saves]
    found.update(edits=len(edits), saves=len(saved))
    kept = [*(state / "pgraph").glob("*.json")]
    texts = [json.loads(path.read_text("utf-8"))["text"] for path in kept[:1]]
    checks = [(text, edits) for text in texts]
    if copy.exists():
        checks.append((copy.read_text("utf-8"), [s for s in edits if s <= saves[max(saved)]]
                       if saved else []))  # fmt: skip
    elif saved:
        found["edits_lost"] += len([s for s in edits if s <= saves[max(saved)]]) or 1
        print(f"a save was acknowledged and no copy is there: {saved}", flush=True)
    if edits and not kept:
        found["edits_lost"] += len(edits)
        print(f"no file is kept: taken {taken}, sent {max(sent)}, saves {saves}", flush=True)
    for text, wanted in checks:
        try:
            there = masses(text)
        except pg.PgraphError:
            found["damaged"] += 1
            continue
        newest: dict[int, int] = {}
        for serial in sorted(wanted):
            newest[sent[serial][0]] = serial
        lost = [(body, serial) for body, serial in newest.items() if there[body] < serial]
        found["edits_lost"] += len(lost)
        if lost:
            print(f"lost in {'saved' if wanted is not edits else 'kept'} file: {lost} of {there};"
                  f" taken {taken[-9:]}, sent {max(sent)}, saves {saves}", flush=True)  # fmt: skip
    return found


def _free(port: int) -> bool:
    """Whether a server can listen on a port now."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            one.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def _left(mark: str) -> int:
    """Processes with this mark in their environment that live on for more than 30 s."""
    found = 0
    for _ in range(300):
        found = 0
        for environment in Path("/proc").glob("[0-9]*/environ"):
            with contextlib.suppress(OSError):
                found += f"{MARK}={mark}".encode() in environment.read_bytes()
        if not found:
            return 0
        time.sleep(0.1)
    return found


def kills(count: int, seed: int, port: int) -> Counter[str]:
    """Servers killed one after the other."""
    rng, found = random.Random(seed), Counter[str]()
    for _ in range(count):
        with tempfile.TemporaryDirectory(prefix="pgraph ü ") as folder:
            found.update(kill_once(rng, Path(folder), port))
    return found


# -- many clients, and one that floods -------------------------------------------------------------


def junk(count: int, seed: int, port: int) -> dict[str, int]:
    """What a server did with `count` messages of which hardly one is what a page sends.

    Twenty pages send them; they are replaced now and then. One honest page must get its answers.
    """
    rng, each, slowest = random.Random(seed), 2000, 0.0
    found = Counter(messages=0, edits_answered=0)
    with _serving(port) as (process, url, said):
        honest = Client(url)
        honest.send("Edit", serial=1, body="2", field="mass", index=[], text="2")
        honest.answer(1)
        before = _size(process.pid)[0]

        def send(seed: int) -> int:
            rng, sent = random.Random(seed), 0
            with contextlib.suppress(ConnectionClosed, OSError):
                page = Client(url)
                page.deaf = True
                for sent in range(1, each + 1):  # noqa: B007
                    page.socket.send(_junk(rng, page.uplink))
                page.socket.close()
            return sent

        with ThreadPoolExecutor(20) as pool:
            waiting = [pool.submit(send, rng.getrandbits(32)) for _ in range(-(-count // each))]
            for serial, one in enumerate(waiting, 2):
                found["messages"] += one.result()
                honest.send("Edit", serial=serial, body="2", field="mass", index=[], text="2")
                asked = time.perf_counter()
                try:
                    honest.answer(serial, 120.0)
                    found["edits_answered"] += 1
                except TimeoutError:
                    print(f"no answer to {serial}", flush=True)
                slowest = max(slowest, time.perf_counter() - asked)
        print(f"slowest answer {slowest:.1f} s")
        if text := said.read_text():
            print(text[-3000:])
        found["raw_errors"] = said.read_text().count("Traceback")
        found["deaths"] = int(not Path(f"/proc/{process.pid}").exists())
        found["grown_mb"] = (_size(process.pid)[0] - before) // 1024
    return dict(found)


KINDS: list[Any] = [k for k in vars(viser._messages).values() if dataclasses.is_dataclass(k)]
EVENTS = {
    name: list(adapter.json_schema().get("properties", {}))
    for name, adapter in page_events().items()
    if name != "Save"  # it would write
}
VALUES: tuple[Any, ...] = (
    None, True, 0, 1, -1, 2.5, 1e308, float("nan"), float("inf"), 2**63, "", "1", "2", "nan",
    "9" * 400, "\0", "<script>", "__proto__", "value", "visible", [], [0] * 100, ["1"], [[[[[]]]]],
    {}, {"a": 1}, "x" * 5000, b"\xff" * 20,
)  # fmt: skip


def _junk(rng: random.Random, uplink: str) -> bytes:
    """A message of a page or of viser with random fields, perhaps with changed bytes."""
    event, kind = rng.choice(list(EVENTS)), rng.choice(KINDS)
    fields = {name: rng.choice(VALUES) for name in EVENTS[event]}
    text = json.dumps({"event": event, **fields}, default=str)
    message: dict[str, Any] = {"type": kind.__name__}
    if rng.random() < 0.4:
        update = (
            {"value": text}
            if rng.random() < 0.9
            else {rng.choice(("visible", "order", "update_cb")): text}
        )
        message = {"type": "GuiUpdateMessage", "uuid": uplink, "updates": update}
    else:
        message |= {field.name: rng.choice(VALUES) for field in dataclasses.fields(kind)}
    raw = bytearray(msgspec.msgpack.encode(message))
    for _ in range(rng.choice((0, 0, 0, 1, 3))):
        raw[rng.randrange(len(raw))] = rng.randrange(256)
    return bytes(raw)


def unread(port: int) -> float:
    """Seconds from the first message of a flood until the server lets its messages lie."""
    with _serving(port) as (_, url, _):
        time.sleep(5.0)
        hostile = Client(url)
        mine = hostile.socket.socket.getsockname()[1]
        stop = threading.Event()

        def shout() -> None:
            while not stop.is_set():
                hostile.send("Select", body="1")

        began = time.perf_counter()
        threading.Thread(target=shout, daemon=True).start()
        since = None  # when bytes began to lie there
        try:
            while time.perf_counter() < began + 20:
                now = time.perf_counter()
                if _lying(port, mine) == 0:
                    since = None
                elif since is None:
                    since = now
                elif now > since + 0.1:
                    return since - began
                time.sleep(0.002)
        finally:
            stop.set()
            hostile.socket.close()
    raise RuntimeError("the server read all that a flood sent in 20 s")


def _lying(port: int, remote: int) -> int:
    """Bytes that have come to this port from another and were not read (Linux)."""
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        words = line.split()
        if [int(word.split(":")[1], 16) for word in words[1:3]] == [port, remote]:
            return int(words[4].split(":")[1], 16)
    return 0


def flood(seconds: float, port: int) -> dict[str, float]:
    """Median delays of one page's edits [ms], alone and while another page floods."""
    with _serving(port) as (_, url, _):
        time.sleep(5.0)  # the kernels load meanwhile
        honest, hostile = Client(url), Client(url)
        found: dict[str, list[float]] = {"alone": [], "flooded": []}
        stop, shouting = threading.Event(), threading.Event()

        def shout() -> None:
            while not stop.is_set():
                if shouting.wait(0.05):
                    hostile.send("Select", body="1")

        threading.Thread(target=shout, daemon=True).start()
        serial = 0
        for k in range(8):  # by turns, so that what else the machine does falls on both
            (shouting.set if k % 2 else shouting.clear)()
            serial += 10**5
            found["flooded" if k % 2 else "alone"] += delays(honest, serial, seconds / 4)
        stop.set()
        hostile.socket.close()
    medians = {name: round(1e3 * statistics.median(some), 1) for name, some in found.items()}
    return {**medians, "unread_after": round(1e3 * unread(port), 1)}


def together(pages: int, edits: int, port: int) -> dict[str, float]:
    """[ms] from an edit of one page until all `pages` have heard of it: median and 95 %."""
    with _serving(port) as (_, url, _):
        time.sleep(5.0)
        clients = [Client(url) for _ in range(pages)]
        found = []
        for k in range(edits):
            text = f"{1.5 + k / 1024:.9f}".rstrip("0")
            for client in clients:
                client.listen_for(text)
            sent = time.perf_counter()
            clients[k % pages].send(
                "Edit", serial=k + 1, body="2", field="mass", index=[], text=text
            )
            found.append(max(client.heard_at(10.0) for client in clients) - sent)
            time.sleep(0.05)
        for client in clients:
            client.socket.close()
    found = [1e3 * x for x in sorted(found)]
    return {
        "median": round(statistics.median(found), 1),
        "most": round(found[int(0.95 * len(found))], 1),
    }


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


@contextlib.contextmanager
def _serving(port: int) -> Iterator[tuple[Process, str, Path]]:
    """A server of a model of 16 bodies, its address, and a file of what it says."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "model.json")
        pg.Model.serial(BODIES).save(file)
        state = Path(folder, "state")
        with server(state, file, port) as (process, url):
            yield process, url, state.with_suffix(".said")


# -- long use --------------------------------------------------------------------------------------


def worn(act: Callable[[int], object], times: int, pid: int) -> dict[str, float]:
    """How a process has grown from a fifth of `times` calls to their end."""
    for k in range(times // 5):
        act(k)
    before = _size(pid)
    for k in range(times // 5, times):
        act(k)
    after = _size(pid)
    return {
        "times": times,
        "memory_percent": round(100 * (after[0] / before[0] - 1), 2),
        "threads": after[1] - before[1],
        "files": after[2] - before[2],
    }


def _size(pid: int) -> tuple[int, int, int]:
    """(resident bytes, threads, open files)"""
    gc.collect()
    at = Path(f"/proc/{pid}")
    status = dict(line.split(":", 1) for line in (at / "status").read_text().splitlines())
    return int(status["VmRSS"].split()[0]), int(status["Threads"]), len([*(at / "fd").iterdir()])


def wear(share: float, port: int) -> Iterator[tuple[str, dict[str, float]]]:
    """(what, growth) of 10^4 runs, CSV files, opened models, pages, and 200 HTML exports."""
    arm, me = pg.Mechanism(pg.Model.serial(3)), os.getpid()
    run = pg.simulate(arm, t_end=0.1)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        pg.Model.serial(BODIES).save(folder / "model.json")
        yield "runs", worn(lambda k: pg.simulate(arm, t_end=0.05), int(1e4 * share), me)
        csv = lambda k: (folder / "a.csv").write_text(run.to_csv())  # noqa: E731
        yield "CSV exports", worn(csv, int(1e4 * share), me)
        opened = lambda k: pg.Mechanism(pg.Model.load(folder / "model.json"))  # noqa: E731
        yield "opened models", worn(opened, int(1e3 * share), me)
        live = lambda k: run.to_html(folder / "a.html", live=True)  # noqa: E731
        yield "HTML exports", worn(live, int(200 * share), me)
        with server(folder / "state", folder / "model.json", port) as (process, url):
            keeper = Client(url)

            def reload(k: int) -> None:
                page = Client(url)
                page.send("Edit", serial=1, body="2", field="mass", index=[], text=str(1 + k % 50))
                page.answer(1)
                page.socket.close()

            yield "pages opened and closed", worn(reload, int(1e3 * share), process.pid)

            def gallery(k: int) -> None:
                name = ("pendulum", "double_pendulum")[k % 2]
                keeper.send("OpenBuiltIn", name=name)
                keeper.send(
                    "Edit", serial=k + 2, body="1", field="mass", index=[], text=str(1 + k % 50)
                )
                keeper.answer(k + 2)

            yield "models opened on a page", worn(gallery, int(1e3 * share), process.pid)


def table(known: dict[str, Any]) -> Iterator[str]:
    """The rows of docs/reliability.md."""
    yield "| what happens | how often | what came of it |"
    yield "|---|---|---|"
    for what, found in known.items():
        if what == "kill -9":
            often = f"{found['kills']} kills, {found['edits']} edits and {found['saves']} saves "
            often += f"acknowledged, {found['runs']} runs begun"
            came = f"{found['edits_lost']} edits lost, {found.get('damaged', 0)} damaged files, "
            came += (
                f"{found['children_left']} children left, port taken {found['port_taken']} times"
            )
            yield f"| kill -9 among edits, saves and runs | {often} | {came} |"
        elif what == "junk":
            came = f"{found['raw_errors']} raw errors, {found['deaths']} deaths, "
            came += f"{found['edits_answered']} edits of an honest page answered meanwhile"
            yield f"| messages that no page sends | {found['messages']} | {came} |"
        elif "median" in found:
            came = f"median {found['median']:.0f} ms, 95 % within {found['most']:.0f} ms"
            pages = what.replace(" [ms]", "")
            yield f"| an edit, until all of {pages} have it | 40 edits | {came} |"
        elif "flooded" in found:
            came = f"median {found['alone']:.0f} ms alone, {found['flooded']:.0f} ms meanwhile; "
            came += f"the flood is not read after {found['unread_after']:.0f} ms"
            yield f"| one page floods, another edits | by turns | {came} |"
        else:
            came = f"memory {found['memory_percent']:+.1f} %, threads {found['threads']:+d}, "
            yield f"| {what} | {found['times']} | {came}files {found['files']:+d} |"


# -- all of it -------------------------------------------------------------------------------------


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=0, help="servers to kill")
    parser.add_argument("--pages", type=int, nargs="*", default=[], help="such as 20 50")
    parser.add_argument("--flood", type=float, default=0.0, metavar="S", help="seconds")
    parser.add_argument("--junk", type=int, default=0, help="messages that no page sends")
    parser.add_argument("--wear", type=float, default=0.0, metavar="SHARE", help="1: all of it")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--add", type=Path, help="a JSON file of counts that are added up")
    args = parser.parse_args()
    known: dict[str, Any] = {}
    if args.add and args.add.exists():
        known = json.loads(args.add.read_text("utf-8"))

    def tell(what: str, found: dict[str, Any]) -> None:
        print(what, found, flush=True)
        known[what] = found
        if args.add:
            args.add.write_text(json.dumps(known, indent=1) + "\n", "utf-8")

    if not (args.kills or args.pages or args.flood or args.junk or args.wear):
        print("\n".join(table(known)))
        return
    print(f"Measured on {machine()}.", flush=True)
    for k in range(0, args.kills, 5):
        before = Counter(known.get("kill -9", {}))
        before.update(kills(min(5, args.kills - k), args.seed + k, args.port))
        tell("kill -9", dict(before))
    for count in args.pages:
        tell(f"{count} pages [ms]", together(count, 40, args.port))
    if args.flood:
        tell("flood [ms]", flood(args.flood, args.port))
    if args.junk:
        sums = Counter(known.get("junk", {}))
        sums.update(junk(args.junk, args.seed, args.port))
        tell("junk", dict(sums))
    if args.wear:
        for what, found in wear(args.wear, args.port):
            tell(what, found)


if __name__ == "__main__":
    main()
