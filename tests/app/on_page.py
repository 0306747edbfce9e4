"""Places on the page, and actions of a person there."""

from typing import Any

import numpy as np

from pgraph_app.scene.camera import extent
from pgraph_app.server import Server

from .conftest import settled, until


def row(page: Any, name: str) -> Any:
    return page.locator(f'table.bodies tr[data-name="{name}"]')


def under_pointer(line: Any, what: Any) -> Any:
    """Return what a line shows while the pointer is over it, wherever the line moves meanwhile."""
    until(lambda: (line.hover(), what.count() and what.is_visible())[1], "what the pointer reveals")
    return what


def press_under_pointer(line: Any, what: Any) -> None:
    """Press what a line shows under the pointer, again if the line moves away before the press."""
    from playwright.sync_api import TimeoutError

    def pressed() -> bool:
        try:
            under_pointer(line, what).click(timeout=2000)
        except TimeoutError:
            return False
        return True

    until(pressed, "a press of what the pointer reveals")


def row_cell(page: Any, name: str, label: str) -> Any:
    """Return a cell of a row, which has it while the pointer is there."""
    return under_pointer(row(page, name), row(page, name).get_by_label(label, exact=True))


def name_cell(page: Any, name: str) -> Any:
    return row_cell(page, name, "name")


def node(page: Any, name: str) -> Any:
    return page.locator(f'svg.digraph g.node[data-name="{name}"]')


def field(page: Any, name: str, k: int = 0) -> Any:
    """A cell of the properties."""
    return page.locator(f'[data-view=properties] [data-field="{name}"] .cell').nth(k)


def ask(page: Any, which: str) -> None:
    """A command of the menu of the model: "new", "open" or "save"."""
    page.locator("button.model-menu").click()
    page.locator(f".pgraph-menu:popover-open button.{which}").click()
    page.locator(f'dialog[data-asked="{which}Question"]').wait_for()


def pose_of_all(page: Any) -> Any:
    """The cells of the pose of all joints, with nothing selected."""
    page.evaluate("pgraph.send('Select', { body: null })")  # as a click beside the bodies does
    page.wait_for_function(
        "pgraph.host('joints').matches('.all') && !pgraph.latest.selected.length"
    )
    page.locator("[data-view=joints]").evaluate("(one) => one.scrollIntoView()")
    return page.locator("[data-view=joints] .joint .cell")


def simulate(page: Any) -> None:
    """Compute the run again, with what stands in the settings, also after a live run."""
    until(lambda: page.evaluate("!pgraph.latest.run?.job"), "the end of the run before")
    page.locator("[data-view=run] button.run").click()
    page.locator("button.play").click(modifiers=["Shift"])


def part_field(page: Any, name: str, k: int = 0) -> Any:
    """A cell of the constraint, contact or force that is open in the inspector."""
    return page.locator(f'[data-view=part] [data-field="{name}"] .cell').nth(k)


def typed(cell: Any, text: str, key: str = "Enter") -> None:
    cell.fill(text)
    cell.press(key)


def chosen(cell: Any, value: str) -> None:
    """Open a drop-down, which fills it, and choose the option with that value.

    Both happen in one task of the page, as nothing is drawn under an open list. Where the option
    is not there yet, the list is opened again.
    """
    choose = """(cell, value) => {
      cell.focus();
      cell.dispatchEvent(new MouseEvent("mousedown", { bubbles: true }));
      if (![...cell.options].some((option) => option.value === value)) return false;
      cell.value = value;
      cell.dispatchEvent(new Event("change", { bubbles: true }));
      return true; }"""
    until(lambda: cell.evaluate(choose, value), f"the choice {value!r}")


def choose_body(page: Any, name: str) -> None:
    page.evaluate("pgraph.front('Bodies')")
    row(page, name).locator("td.number").click()
    page.wait_for_function("(n) => pgraph.latest.properties.bodies.join() === n", arg=name)


def refused(page: Any, *parts: str) -> None:
    """A cell is refused, and a sentence beside one names the parts."""
    page.wait_for_function(
        """(parts) => document.querySelector('.cell.refused')
           && [...document.querySelectorAll('.sentence')].some((one) => one.checkVisibility()
           && parts.every((part) => one.textContent.includes(part)))""",
        arg=list(parts),
    )


def nothing_refused(page: Any) -> None:
    page.wait_for_function("!document.querySelector('.refused, .waiting')")


def names(served: Server) -> list[str]:
    return [body.name for body in served.store.state.model.bodies]


def selections(served: Server) -> list[str | None]:
    return [client.selection for client in served.store.state.clients.values()]


def in_sight(served: Server, view: str) -> bool:
    """The server knows a page on which the view of a tab is visible."""
    return any(view in client.sees for client in served.store.state.clients.values())


def client_of(served: Server) -> int:
    """The page that came last."""
    return max(served.store.state.clients)


def selected_everywhere(page: Any, name: str) -> None:
    """Table, digraph, Pgraph and properties show `name` and nothing else as selected."""
    page.wait_for_function(
        """(name) => [
      [...document.querySelectorAll('table.bodies tr.selected:has(.gutter .node)')]
        .map((e) => e.dataset.name),
      [...document.querySelectorAll('svg.digraph g.node.selected')].map((e) => e.dataset.name),
      [...new Set([...document.querySelectorAll('.vectors .selected')].map((e) => e.dataset.name))],
      [document.querySelector('.heading strong')?.textContent],
    ].every((mark) => mark.length === 1 && mark[0] === name)""",
        arg=name,
    )


def rows_selected(page: Any, *wanted: str) -> None:
    page.wait_for_function(
        "(names) => [...document.querySelectorAll('tr.selected')]"
        ".map((e) => e.dataset.name).join() === names.join()",
        arg=list(wanted),
    )


def focused(page: Any) -> list[str]:
    """Row and kind of the focused cell."""
    return page.evaluate("""() => {
      const cell = document.activeElement;
      return [cell.closest('tr')?.dataset.name, cell.getAttribute('aria-label') ?? cell.tagName];
    }""")


def paste(page: Any, text: str) -> None:
    """Paste as the browser does at Ctrl+V with this text on the clipboard."""
    page.evaluate(
        """(text) => {
      const data = new DataTransfer();
      data.setData('text/plain', text);
      document.activeElement.dispatchEvent(new ClipboardEvent('paste',
        { clipboardData: data, bubbles: true, cancelable: true }));
    }""",
        text,
    )


def copied(page: Any) -> str:
    return page.evaluate("""() => {
      const data = new DataTransfer();
      document.activeElement.dispatchEvent(new ClipboardEvent('copy',
        { clipboardData: data, bubbles: true, cancelable: true }));
      return data.getData('text/plain');
    }""")


def drop(page: Any, name: str, content: str) -> None:
    """Drop a file on the page, where `content` is JavaScript for its parts."""
    page.evaluate(
        """([name, content]) => {
      const data = new DataTransfer();
      data.items.add(new File(eval(content), name));
      for (const type of ['dragover', 'drop']) {
        document.body.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true }));
      }
    }""",
        [name, content],
    )


def notice(page: Any, *parts: str) -> None:
    """Wait for a notice with these parts and close it."""
    page.wait_for_function(
        """(parts) => [...document.querySelectorAll('.pgraph-toast')].some((note) =>
           parts.every((part) => note.textContent.includes(part)) && (note.remove(), true))""",
        arg=list(parts),
    )


def cut_off(page: Any, served: Server) -> None:
    """The page loses its connection and comes back."""
    before = set(served.store.state.clients)
    served.viser._websock_server.disconnect_all_clients()
    until(lambda: set(served.store.state.clients) - before, "the page to come back")
    until(lambda: len(served.store.state.clients) == len(before), "the lost ones to be gone")
    until(lambda: all(c.aspect for c in served.store.state.clients.values()), "its view's shape")


# -- the 3D view -----------------------------------------------------------------------------------


def drawn(page: Any, node: str, there: bool = True) -> None:
    """The 3D view has such a node, or has it no more."""
    page.wait_for_function(
        "([name, there]) => (name in window.__viserSceneTree.getState()) === there",
        arg=[node, there],
    )


def place(page: Any, node: str) -> list[float] | None:
    """Return the position of a node of the 3D view [m], or None."""
    return page.evaluate(
        "(name) => window.__viserMutable.nodeRefFromName[name]?.position.toArray() ?? null", node
    )


def camera(page: Any) -> np.ndarray:
    """(6,) from what the camera looks at to the camera, and what it looks at, in three.js's axes.

    Of a camera that moves: where it will be.
    """
    return np.asarray(
        page.evaluate(
            """() => { const c = window.__viserMutable.cameraControl, a = c.camera.position.clone();
           const b = a.clone(); c.getPosition(a, true); c.getTarget(b, true);
           return [a.x - b.x, a.y - b.y, a.z - b.z, b.x, b.y, b.z]; }"""
        )
    )


def distance(page: Any) -> float:
    return float(np.linalg.norm(camera(page)[:3]))


def at_rest(page: Any) -> np.ndarray:
    """Return the camera's position, once two consecutive pictures have it."""
    page.wait_for_function("""() => {
      const c = window.__viserMutable.cameraControl, at = c.camera.position, end = at.clone();
      c.getPosition(end, true);
      window.__viserMutable.requestRender();
      const eye = c.camera.matrixWorld.elements;
      const drawn = Math.hypot(eye[12] - at.x, eye[13] - at.y, eye[14] - at.z);
      const before = window.cameraBefore ?? at.clone().multiplyScalar(2);
      window.cameraBefore = at.clone();
      return at.distanceTo(end) + at.distanceTo(before) + drawn < 1e-3 * end.length();
    }""")
    return camera(page)


def steady(page: Any, served: Server) -> np.ndarray:
    """Return the camera's position, once it stays while messages go to the page and back."""

    def unmoved() -> bool:
        before = at_rest(page)
        settled(page, served)
        return np.allclose(at_rest(page), before, rtol=1e-6)

    until(unmoved, "a camera at rest")
    return at_rest(page)


def within(page: Any, served: Server) -> bool:
    """Whether all that is drawn of the model is in the 3D view."""
    places = page.evaluate(
        """(points) => {
           const box = (what) => document.querySelector(what).getBoundingClientRect();
           const view = box('canvas:not(.pgraph *)');
           return points.map((p) => { const [x, y] = pgraph.picking.projected(p) ?? [-1, -1];
             const { left, right, top, bottom } = view;
             return x >= left && x <= right && y >= top && y <= bottom; }); }""",
        extent(served.store.state).tolist(),
    )  # fmt: skip
    return all(places)


def on_screen(page: Any, point: Any) -> tuple[float, float]:
    """Return the place of a point of the world on the page."""
    return tuple(page.evaluate("(p) => pgraph.picking.projected(p)", np.asarray(point).tolist()))


def middle_of(served: Server, name: str) -> np.ndarray:
    corners = extent(served.store.state, (name,))
    return (corners.min(axis=0) + corners.max(axis=0)) / 2


def frames(page: Any, number: int = 2) -> None:
    """The browser has drawn so many pictures."""
    page.evaluate(
        "(k) => new Promise((done) => { (function next() { "
        "k-- > 0 ? requestAnimationFrame(next) : done(true); })(); })",
        number,
    )
