"""Save replaces only what this session wrote, or what a person said it may."""

from __future__ import annotations

import os

import pytest

import pgraph_core as pg
from pgraph_app.core import cells
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.run.worker import Files
from pgraph_app.session.update import Connected, Save, Saved


@pytest.fixture
def save():
    """A function (path, replace) -> the outcome, of one session."""
    sent: list = []
    files, state = Files(sent.append), update(initial(pg.Model.serial(2)), Connected(1))

    def saved(path, replace: bool = False) -> Saved:
        files.render(state, update(state, Save(1, 1, str(path), replace)))
        return sent[-1]

    return saved


def test_a_file_of_another_is_replaced_only_when_told_to(tmp_path, save):
    thesis = tmp_path / "precious.json"
    thesis.write_text('{"my": "thesis data"}')
    refused = save(thesis)
    assert str(thesis) in refused.problem
    assert refused.offer == "Replace it"
    assert thesis.read_text() == '{"my": "thesis data"}'
    assert save(thesis, replace=True).problem == ""
    assert pg.Model.load(thesis) == pg.Model.serial(2)


def test_what_this_session_wrote_is_replaced_until_another_changes_it(tmp_path, save):
    path = tmp_path / "model.json"
    assert save(path).problem == ""
    assert save(path).problem == ""
    path.write_text("{}")
    assert save(path).offer == "Replace it"
    assert path.read_text() == "{}"


def test_special_files_and_folders_are_never_replaced(tmp_path, save):
    pipe, folder = tmp_path / "pipe.json", tmp_path / "folder.json"
    os.mkfifo(pipe)
    folder.mkdir()
    for path in (pipe, folder):
        answer = save(path, replace=True)
        assert "not an ordinary file" in answer.problem
        assert answer.offer == ""
    assert pipe.is_fifo()


def test_a_link_is_followed_and_its_place_is_named(tmp_path, save):
    real = tmp_path / "real" / "model.json"
    real.parent.mkdir()
    link, circle = tmp_path / "link.json", tmp_path / "circle.json"
    link.symlink_to(real)
    circle.symlink_to(circle)
    answer = save(link)
    assert answer.problem == ""
    assert str(real) in answer.path
    assert link.is_symlink()
    assert real.is_file()
    assert save(circle).problem


@pytest.mark.parametrize("name", ["\u202e.json", "a\x1b[2J.json", "x.json/", "a\nb.json"])
def test_a_name_that_nobody_can_read_is_refused(tmp_path, save, name):
    answer = save(f"{tmp_path}/{name}", replace=True)
    assert "is no name that can be read" in answer.problem
    assert list(tmp_path.iterdir()) == []


def test_a_link_to_a_device_and_paths_that_cannot_be_are_sentences(tmp_path, save):
    (tmp_path / "null.json").symlink_to("/dev/null")
    assert "/dev/null is not an ordinary file" in save(tmp_path / "null.json").problem
    (tmp_path / "round.json").symlink_to("round.json")
    assert "its links lead in a circle" in save(tmp_path / "round.json").problem
    for name in ("x" * 300, "nul\0"):
        problem = save(f"{tmp_path}/{name}.json").problem
        assert problem
        assert "Errno" not in problem
        assert "embedded" not in problem


@pytest.mark.parametrize("typed", ["\u0661\u0662", "\uff11.5", "\u0663+1", "1_0"])
def test_digits_of_other_scripts_are_no_numbers(typed):
    with pytest.raises(cells.Refusal):
        cells.number(typed)
    with pytest.raises(cells.Refusal):
        cells.whole(typed, 0, 100)
