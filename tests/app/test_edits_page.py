"""What an edit touches on the page: the rows and signs that it changes, and nothing else."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from pgraph_app.model.update import Edit, NewModel, Undo
from pgraph_app.server import Server
from pgraph_app.session.update import Select
from pgraph_app.table.update import Duplicate

from .conftest import NOBODY, until
from .test_page import drawn

WATCH = """() => {
  window.touched = [];
  window.watches?.forEach((watch) => watch.disconnect());
  const said = (el) => {
    const own = (el.nodeType === 1 ? el : el.parentElement)?.closest("tr, g, button.entry");
    return own && [own.tagName.toLowerCase(), own.dataset.name ?? own.dataset.edge ?? ""].join(" ");
  };
  window.watches = ["table.bodies tbody", "svg.digraph", ".vectors"].map((place) => {
    const watch = new MutationObserver((found) => {
      for (const { target, addedNodes } of found)
        touched.push(...(addedNodes.length ? [...addedNodes] : [target]).map(said));
    });
    const what = { childList: true, characterData: true, attributes: true, subtree: true };
    watch.observe(document.querySelector(place), what);
    return watch;
  });
}"""


@pytest.fixture
def chain(page: Any, served: Server) -> Any:
    """The page on five bodies in a row, and a watch on its table and digraph."""
    served.send(NewModel(NOBODY, 1, "5"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 5")
    page.wait_for_function("() => pgraph.latest.digraph.names.length === 5")
    settled(page, served)
    page.evaluate(WATCH)
    return page


def settled(page: Any, served: Server) -> None:
    """Everything sent so far is drawn: messages come in order, so an edit after all others is."""
    names = [body.name for body in served.store.state.model.bodies]
    for name in (names[0], None):
        for client in served.store.state.clients:
            served.send(Select(client, name))
        page.wait_for_function(
            "(name) => pgraph.latest.selection === name"
            " && pgraph.latest.selected.length === Number(Boolean(name))",
            arg=name,
        )


def touched(page: Any) -> set[str]:
    page.evaluate("() => new Promise((done) => setTimeout(done))")  # records come in a microtask
    return set(page.evaluate("() => touched.splice(0)")) - {None, "g ground"}


def edit(page: Any, served: Server, serial: int, body: str, field: Any, text: str) -> set[str]:
    before = served.store.state.derived
    served.send(Edit(NOBODY, serial, body, field, (), text))
    until(lambda: served.store.state.derived is not before, "an edited model")
    sent = served.store.state.model.to_json()
    page.wait_for_function(
        "(n) => pgraph.latest.table.rows.map((r) => r.name + r.parent + r.dof).join() === n",
        arg=",".join(f"{b.name}{b.parent}{b.dof}" for b in served.store.state.model.bodies),
    )
    page.wait_for_function("(mass) => pgraph.latest.digraph.masses.join() === mass.join()",
        arg=[body.mass for body in served.store.state.model.bodies])  # fmt: skip
    assert sent == served.store.state.model.to_json()
    return touched(page)


def test_an_edit_of_one_cell_touches_only_what_it_changes(chain: Any, served: Server):
    assert edit(chain, served, 1, "2", "mass", "7.5") == set()
    renamed = edit(chain, served, 2, "3", "name", "thigh")
    assert renamed == {"tr thigh", "tr 4", "g thigh", "button thigh"}
    assert edit(chain, served, 3, "5", "dof", "2") >= {"tr 5", "g 5", "button 5"}
    assert touched(chain) <= {"tr 5", "g 5", "button 5"}


def test_bodies_in_3d_are_sent_again_only_where_they_look_different(chain: Any, served: Server):
    """The 3D view draws what it was sent: after an edit of a name the meshes are the same ones."""
    assert drawn(chain, "/bodies/1")
    keep = "() => window.kept = Object.values(__viserSceneTree.getState()).map((n) => n?.message)"
    same = """() => Object.entries(__viserSceneTree.getState())
      .filter(([name]) => /^.bodies.\\d+$/.test(name)).every(([, n]) => kept.includes(n.message))"""
    chain.evaluate(keep)
    edit(chain, served, 4, "3", "name", "thigh")
    until(lambda: caught_up_with(chain, served), "the scene")
    assert chain.evaluate(same)


LINKED = """() => {
  const proto = WebGL2RenderingContext.prototype, link = proto.linkProgram;
  window.linked = 0;
  proto.linkProgram = function (program) { window.linked++; link.call(this, program); };
}"""
PICTURES = """() => new Promise((done) => {
  let n = 0;
  (function next() { if (n++ > 20) done(); else requestAnimationFrame(next); })();
})"""


def test_a_body_that_comes_again_compiles_no_shader_again(chain: Any, served: Server):
    """A copy makes the 3D view anew; its shaders took software GL more than a second.

    What is drawn for the first time may come late, so a single round may link a program.
    """
    chain.evaluate(LINKED)
    me, linked = next(iter(served.store.state.clients)), []
    for _ in range(4):
        served.send(Duplicate(me, ("5",), True))
        until(lambda: drawn(chain, "/bodies/6"), "the copy in the 3D view")
        chain.evaluate(PICTURES)
        served.send(Undo(me))
        until(lambda: not drawn(chain, "/bodies/6"), "the copy gone")
        chain.evaluate(PICTURES)
        linked.append(chain.evaluate("linked"))
    assert any(before == after for before, after in pairwise(linked)), linked


def caught_up_with(page: Any, served: Server) -> bool:
    for client in served.store.state.clients:
        served.send(Select(client, "1"))
    page.wait_for_function("() => pgraph.latest.selection === '1'")
    return drawn(page, "/selected/outline")
