"""Save replaces only files of its own session, unless a person allows more."""

import os

import pytest

import pgraph_core as pg
from pgraph_app.session.autosave import Files

from .store import ME, after, begun, do

pytestmark = pytest.mark.quick


@pytest.fixture
def save():
    """A function (path, replace) -> the outcome, of one session."""
    sent = []
    files, state = Files(sent.append), begun(pg.Model.serial(2))

    def saved(path, replace=False):
        files.render(state, after(state, do.Save(ME, 1, str(path), replace)))
        return sent[-1]

    return saved


def test_a_file_of_another_is_replaced_only_when_told_to(tmp_path, save):
    thesis = tmp_path / "precious.json"
    thesis.write_text('{"my": "thesis data"}')
    refused = save(thesis)
    assert str(thesis) in refused.problem
    assert refused.offer
    assert thesis.read_text() == '{"my": "thesis data"}'
    assert save(thesis, replace=True).problem == ""
    assert pg.Model.load(thesis) == pg.Model.serial(2)
    assert save(thesis).problem == ""  # this session wrote it
    thesis.write_text("{}")
    assert save(thesis).offer
    assert thesis.read_text() == "{}"


def test_special_files_and_folders_are_never_replaced(tmp_path, save):
    pipe, folder, null = (tmp_path / f"{name}.json" for name in ("pipe", "folder", "null"))
    os.mkfifo(pipe)
    folder.mkdir()
    null.symlink_to("/dev/null")
    for path, named in ((pipe, pipe), (folder, folder), (null, "/dev/null")):
        answer = save(path, replace=True)
        assert str(named) in answer.problem
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


@pytest.mark.parametrize(
    "name", ["\u202e.json", "a\x1b[2J.json", "x.json/", "a\nb.json", "x" * 300, "nul\0.json"]
)
def test_a_name_that_nobody_can_read_or_that_cannot_be_is_refused(tmp_path, save, name):
    problem = save(f"{tmp_path}/{name}", replace=True).problem
    assert problem
    assert not any(word in problem for word in ("Errno", "embedded"))
    assert list(tmp_path.iterdir()) == []
