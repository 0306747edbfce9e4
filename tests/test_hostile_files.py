"""Damaged files of every kind: a reader answers with a value or a sentence, soon, and lives."""

import os

import pytest

from benchmarks import hostile_files
from benchmarks.hostile_files import NAMES, attack

EXPLORES = bool(os.environ.get("PGRAPH_EXPLORE"))


@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_file_gets_a_value_or_a_sentence(name):
    if name == "xml":
        pytest.importorskip("mujoco")
    first = int.from_bytes(os.urandom(3), "little") if EXPLORES else 0
    tally = attack(name, range(first, first + (5000 if EXPLORES else 40)))
    assert not tally.raw, f"seeds from {first}"
    assert tally.deaths == tally.slow == 0


def test_a_fault_in_a_reader_is_counted(monkeypatch):
    plain = hostile_files.load_mesh
    seen = []

    def faulty(path):
        seen.append(path)
        return plain(path) if len(seen) < 3 else 1 / 0

    monkeypatch.setattr(hostile_files, "load_mesh", faulty)
    tally = attack("stl", range(4))
    assert tally.inputs == 4
    assert sum(tally.raw.values()) >= 3
