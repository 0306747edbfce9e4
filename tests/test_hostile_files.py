"""Damaged files of every kind: a reader answers with a value or a sentence, soon, and lives."""

import os

import pytest

import pgraph_core as pg
from benchmarks import hostile_files
from benchmarks.hostile_files import NAMES, attack
from pgraph_core.formats import read_model

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


@pytest.mark.parametrize(
    ("name", "text", "fact"),
    [
        (
            "a.urdf",
            '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
            '<origin rpy="1 1 1"/><inertia ixx="1e308" iyy="1e308" izz="1e308" ixy="1e308"'
            ' ixz="1e308" iyz="1e308"/></inertial></link><joint name="j" type="revolute">'
            '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>',
            "its numbers overflow",
        ),
        (
            "a.xml",
            '<mujoco><worldbody><body name="b" quat="1e308 1e308 0 0"><freejoint/>'
            '<geom size="0.1"/></body></worldbody></mujoco>',
            "body 'b'",
        ),
    ],
)
def test_numbers_that_overflow_are_a_sentence(name, text, fact, tmp_path):
    if name.endswith(".xml"):
        pytest.importorskip("mujoco")
    (tmp_path / name).write_text(text)
    with pytest.raises(pg.PgraphError, match=fact):
        read_model(tmp_path / name)
