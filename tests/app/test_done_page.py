"""Interface 1.7, checklist of the session: finished work is told where nobody looks."""

from __future__ import annotations

from typing import Any

import pytest

FINISH = """([topic, hidden, problem]) => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  const before = pgraph.latest[topic], job = { text: "50 %", fraction: 0.5 };
  pgraph.receive(topic, { ...before, job });
  const end = performance.now() + 5;
  while (performance.now() < end);
  pgraph.receive(topic, { ...before, job: null, problem });
  const told = [document.title, document.querySelector(".pgraph-toast")?.textContent ?? ""];
  document.querySelector(".pgraph-toast")?.remove();
  delete document.hidden;
  document.dispatchEvent(new Event("visibilitychange"));
  pgraph.receive(topic, before);
  return [...told, document.title];
}"""


@pytest.mark.parametrize("topic", ["run", "reports"])
def test_work_that_ends_behind_another_window_is_told_in_the_title(page: Any, topic: str):
    title, toast, after = page.evaluate(FINISH, [topic, True, ""])
    assert title == f"✓ {toast} – quadruped – Pgraph"
    assert toast.startswith("Simulated: " if topic == "run" else "Ready: ")
    assert after == "quadruped – Pgraph"
    title, toast, _ = page.evaluate(FINISH, [topic, True, "It failed."])
    assert (title, toast) == ("✗ It failed. – quadruped – Pgraph", "It failed.")


def test_quick_work_before_one_s_eyes_is_not_told(page: Any):
    assert page.evaluate(FINISH, ["run", False, ""])[1] == ""
