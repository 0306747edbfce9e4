"""An edit changes its rows and signs on the page, and nothing else."""

from itertools import pairwise
from typing import Any

from pgraph_app.constraints.update import AddPart
from pgraph_app.model import Undo
from pgraph_app.properties.update import EditBodies
from pgraph_app.server import Server
from pgraph_app.table import Duplicate

from .conftest import NOBODY, settled, until
from .on_page import choose_body, client_of, drawn, frames, row

WATCH = """() => {
  window.touched = [];
  const said = (el) => {
    const own = (el.nodeType === 1 ? el : el.parentElement)?.closest("tr, g, .entry");
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
LINKED = """() => {
  const proto = WebGL2RenderingContext.prototype, link = proto.linkProgram;
  window.linked = 0;
  proto.linkProgram = function (program) { window.linked++; link.call(this, program); };
}"""


def edit(page: Any, served: Server, body: str, field: Any, text: str) -> set[str]:
    """Make an edit and return what it changes, once it is in the table and the digraph."""
    before = served.store.state.derived
    served.send(EditBodies(NOBODY, 1, (body,), field, (((), text),)))
    until(lambda: served.store.state.derived is not before, "an edited model")
    bodies = served.store.state.model.bodies
    page.wait_for_function(
        "([rows, masses]) => pgraph.latest.digraph.masses.join() === masses"
        " && pgraph.latest.table.rows.map((r) => r.name + r.parent + r.dof).join() === rows",
        arg=[
            ",".join(f"{b.name}{b.parent}{b.dof}" for b in bodies),
            ",".join(f"{b.mass:g}" for b in bodies),
        ],
    )
    page.evaluate("() => new Promise((done) => setTimeout(done))")  # records come in a microtask
    return set(page.evaluate("() => touched.splice(0)")) - {None, "g ground"}


def test_an_edit_touches_only_what_it_changes(page: Any, served: Server):
    page.evaluate(WATCH)
    try:
        page.evaluate(
            "() => window.kept = Object.values(__viserSceneTree.getState()).map((n) => n?.message)"
        )
        assert edit(page, served, "shank", "mass", "7.5") == set()
        touched = edit(page, served, "thigh", "name", "femur")
        assert touched == {"tr femur", "tr shank", "g femur", "span femur"}
        settled(page, served)
        drawn(page, "/bodies/1")
        assert page.evaluate(  # the meshes in 3D are the same ones
            """() => Object.entries(__viserSceneTree.getState())
          .filter(([name]) => /^.bodies.\\d+$/.test(name))
          .every(([, n]) => kept.includes(n.message))"""
        )
        page.evaluate("touched.splice(0)")
        assert edit(page, served, "arm", "dof", "2") >= {"tr arm", "g arm", "span arm"}
    finally:
        page.evaluate("watches.forEach((watch) => watch.disconnect())")


def test_a_body_that_comes_again_compiles_no_shader_again(page: Any, served: Server):
    """A copy redraws the 3D view, whose shaders took software GL more than a second.

    First drawings may be late, so a single round may link a program.
    """
    page.evaluate(LINKED)
    me, linked = client_of(served), []
    for _ in range(4):
        served.send(Duplicate(me, ("arm",), True))
        drawn(page, "/bodies/5")
        frames(page, 20)
        served.send(Undo(me))
        drawn(page, "/bodies/5", there=False)
        frames(page, 20)
        linked.append(page.evaluate("linked"))
    assert any(before == after for before, after in pairwise(linked)), linked


def test_a_click_on_the_row_of_a_body_shows_it_also_if_a_connection_is_open(page, served):
    """The form of a connection stayed when its body was selected before."""
    choose_body(page, "thigh")
    client = client_of(served)
    served.send(AddPart(client, "forces", "motor", "thigh"))
    page.wait_for_function("document.querySelector('[data-view=part] .field')?.checkVisibility()")
    page.evaluate("pgraph.front('Bodies')")
    row(page, "thigh").locator("td.number").click()
    page.wait_for_function(
        "!document.querySelector('[data-view=part] .field')?.checkVisibility()"
        " && pgraph.latest.properties.bodies.join() === 'thigh'"
    )
