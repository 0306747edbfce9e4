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


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<replicate count="1000000"><geom size="1"/></replicate>', r"make 2e\+06 elements; 20000"),
        ('<replicate count="300">' * 5 + '<geom size="1"/>' + "</replicate>" * 5, "20000 at most"),
        ('<replicate count=" 99999999 "><geom size="1"/></replicate>', "20000 at most"),
    ],
)
def test_copies_without_end_are_refused_before_they_are_made(inside, said, tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "a.xml"
    file.write_text(f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
    with pytest.raises(pg.FileError, match=said):
        pg.read_mjcf(file)


def test_so_are_heights(tmp_path):
    pytest.importorskip("mujoco")
    field = '<hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/>'
    file = tmp_path / "a.xml"
    file.write_text(f"<mujoco><asset>{field}</asset></mujoco>")
    with pytest.raises(pg.FileError, match="line 1, hfield, nrow: nrow times ncol must be at most"):
        pg.read_mjcf(file)
