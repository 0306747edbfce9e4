"""Pytest plugin of `python -m tests.mutants`: trace the tests, or run them against mutants.

A trace writes one line per test: the mutants whose sites it executes, its result and duration.
A run imports and collects everything once. For each mutant a forked child then runs the tests that
reach it, until one fails.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import mutant_switch as switch
import pytest
from hypothesis import Phase, settings

LEAST = 15  # tests per mutant, even if they exceed the budget
PATIENCE = 30.0, 8.0  # processor time allowed per test: seconds, plus a multiple of its duration
STUCK = 900  # seconds until a child that waits for something is killed
MODE, _, PLACE = os.environ["PGRAPH_MUTANTS"].partition(":")
AT = Path(PLACE)


def pytest_configure(config: pytest.Config) -> None:
    """Register the plugin of the chosen mode."""
    config.pluginmanager.register({"trace": Trace, "run": Run}[MODE]())


class Trace:
    """Record the mutants reached by each test, including those reached by its shared fixtures."""

    def __init__(self):
        worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
        self.path = AT / f"trace.{worker}.jsonl"
        self.path.write_text("")
        self.shared: dict[object, set[int]] = {}
        self.seconds, self.passed = 0.0, False

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Record what import and collection reach, under an empty test name."""
        self.write(test="", passed=True, seconds=0.0, reached=sorted(switch.reached()))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef):
        """Record what the set-up of a fixture reaches, for every test that uses it."""
        before = switch.reached()
        switch.forget()
        try:
            return (yield)
        finally:
            reached = self.shared[fixturedef] = switch.reached()
            for k in reached | before:
                switch.BLOCK[switch.START + k] = 1

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item):
        """Write the line of one test."""
        switch.forget()
        self.seconds, self.passed = 0.0, False
        try:
            return (yield)
        finally:
            found = switch.reached()
            for used in item._fixtureinfo.name2fixturedefs.values():
                found |= set().union(*(self.shared.get(u, ()) for u in used))
            line = {"test": item.nodeid, "passed": self.passed, "seconds": round(self.seconds, 4)}
            self.write(**line, reached=sorted(found))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up set-up, call and teardown."""
        self.seconds += report.duration
        self.passed = report.passed and (self.passed or report.when == "call")

    def write(self, **line: object) -> None:
        """Append one line of JSON."""
        with self.path.open("a") as file:
            file.write(json.dumps(line) + "\n")


class Run:
    """Run, for each mutant, the tests that reach it."""

    def __init__(self):
        lines = [json.loads(line) for line in (AT / "trace.jsonl").read_text().splitlines()]
        self.tests = {line["test"]: line for line in lines if line["passed"] and line["test"]}
        self.sound: dict[str, bool] = {}  # whether a test passes without a mutant
        self.failed: list[str] = []
        self.found: dict[int, dict] = {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Turn off Hypothesis' shrinking of failing examples."""
        phases = [Phase.explicit, Phase.generate]
        settings.register_profile("mutants", settings(settings.default, phases=phases))
        settings.load_profile("mutants")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record a failure."""
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run all mutants, `jobs` at a time, and write each result when it is known."""
        from pgraph_core.engine import warm_up

        for _ in warm_up():  # load all kernels before forking
            pass
        items = {item.nodeid: item for item in session.items}
        given = json.loads((AT / "wanted.json").read_text())
        self.budget = given["budget"]  # seconds of recorded test time per mutant
        waiting, running = list(given["mutants"]), {}
        while waiting or running:
            while waiting and len(running) < given["jobs"]:
                k = waiting.pop(0)
                chosen = [items[t] for t in self.chosen(k) if t in items]
                running[self.start(k, chosen)] = k, chosen
            pid, status = os.wait()
            if pid not in running:
                continue
            k, chosen = running.pop(pid)
            result = self.result(pid, status, len(chosen))
            killer = result.get("test")
            if killer and not self.is_sound(items[killer]):
                waiting.insert(0, k)
                continue
            self.found[k] = result
            (AT / "found.json").write_text(json.dumps(self.found))
            print(k, *result.values(), flush=True)
        return True

    def chosen(self, k: int) -> list[str]:
        """Select sound tests within the budget, preferring short ones and many files."""
        by_file = defaultdict(list)
        for name, line in self.tests.items():
            if k in line["reached"] and self.sound.get(name, True):
                by_file[name.split("::")[0]].append((line["seconds"], name))
        ranked = []
        for tests in by_file.values():
            ranked += [(s * rank, s, name) for rank, (s, name) in enumerate(sorted(tests), start=1)]
        spent, taken = 0.0, []
        for _, seconds, name in sorted(ranked):
            if len(taken) < LEAST or spent + seconds <= self.budget:
                spent += seconds
                taken.append((seconds, name))
        cost = defaultdict(float)  # per file, so that tests of one file stay together
        for seconds, name in taken:
            cost[name.split("::")[0]] += seconds
        files = {name: name.split("::")[0] for _, name in taken}
        return [n for s, n in sorted(taken, key=lambda x: (cost[files[x[1]]], files[x[1]], *x))]

    def start(self, k: int, items: list[pytest.Item]) -> int:
        """Fork a child that runs tests against mutant k until one fails. Return its process id."""
        if pid := os.fork():
            return pid
        try:
            self.run(k, items)
        finally:
            os._exit(0)

    def run(self, k: int, items: list[pytest.Item]) -> None:
        """In the child: write a line per test begun, then `end` or `failed`, into its file."""
        os.setsid()
        place = tempfile.mkdtemp(prefix="mutant")
        os.environ["PYTEST_DEBUG_TEMPROOT"] = place
        report = (AT / f"child.{os.getpid()}").open("w")
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        signal.alarm(STUCK)
        switch.activate(k)
        start = time.process_time()
        for item, following in zip(items, [*items[1:], None]):
            print(item.nodeid, file=report, flush=True)
            used = int(time.process_time())
            limit = int(PATIENCE[0] + PATIENCE[1] * self.tests[item.nodeid]["seconds"])
            resource.setrlimit(resource.RLIMIT_CPU, (used + limit, resource.RLIM_INFINITY))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failed:
                break
        word, seconds = "failed" if self.failed else "end", time.process_time() - start
        print(f"\n{word} {seconds:.1f}", file=report)
        report.close()
        shutil.rmtree(place, ignore_errors=True)

    def result(self, pid: int, status: int, count: int) -> dict:
        """Read a child's result. If a signal killed it, the current test caught the mutant."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # subprocesses of its tests
        path = AT / f"child.{pid}"
        *tests, last = path.read_text().split("\n")[:-1] or [""]
        path.unlink()
        if not count:
            return {"result": "not reached"}
        word, _, seconds = last.partition(" ")
        ran = [t for t in tests if t]
        if word == "end" and not os.WIFSIGNALED(status):
            return {"result": "survived", "tests": count, "seconds": float(seconds)}
        if word == "failed":
            taken = {"tests": len(ran), "seconds": float(seconds)}
            return {"result": "caught", **taken, "test": ran[-1]}
        how = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else "exit"
        return {"result": "caught", "tests": len(ran) + 1, "how": how, "test": last}

    def is_sound(self, item: pytest.Item) -> bool:
        """Return whether a test passes in a child without a mutant, tried once per test."""
        if item.nodeid not in self.sound:
            pid = self.start(switch.NONE, [item])
            result = self.result(*os.waitpid(pid, 0), 1)
            self.sound[item.nodeid] = result["result"] == "survived"
        return self.sound[item.nodeid]
