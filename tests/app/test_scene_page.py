"""Digraph and 3D view by mouse and keys: drag, focus, camera, picking, and what is drawn."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.digraph import StepThrough
from pgraph_app.gait import Simulate
from pgraph_app.model import Undo
from pgraph_app.playback import Pause, Scrub
from pgraph_app.pose.update import HomePose, MoveJoint
from pgraph_app.properties.update import EditBodies
from pgraph_app.run import SetRun
from pgraph_app.scene import Show, View, ties
from pgraph_app.scene.camera import extent
from pgraph_app.server import Server
from pgraph_app.table import DeleteBodies
from pgraph_core.show.stage import TOWARDS, towards

from .conftest import MOTION, NOBODY, SIZE, UNDRAWN, opened, settled, until
from .on_page import (
    at_rest,
    camera,
    choose_body,
    client_of,
    distance,
    drawn,
    frames,
    middle_of,
    node,
    on_screen,
    pose_of_all,
    refused,
    selections,
    steady,
    typed,
    within,
)
from .store import LIMIT


def circle(page: Any, name: str) -> tuple[float, float]:
    """Return the place of a node's circle on the page."""
    box = node(page, name).locator("circle").last.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_nodes_are_hovered_and_walked_along(page, served):
    last = served.store.state.model
    page.mouse.move(*circle(page, "shank"))
    told = node(page, "shank").locator("title")
    for part in ("shank", "revolute", "thigh", f"{last.body('shank').mass:g} kg"):
        until(lambda part=part: part in (told.text_content() or ""), f"{part} in the title")
    lit = "[...document.querySelectorAll('.vectors .path')].map((e) => e.dataset.name)"
    until(lambda: set(page.evaluate(lit)) == {"trunk", "thigh", "shank"}, "the path to the ground")
    page.mouse.move(SIZE["width"] / 2, SIZE["height"] / 2)

    node(page, "trunk").focus()
    for key in ("ArrowDown", "ArrowDown"):  # thigh, shank
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    until(lambda: "shank" in selections(served), "shank selected")
    served.send(
        EditBodies(NOBODY, 0, ("arm",), "mass", (((), "7"),))
    )  # somebody else's: drawn anew
    page.wait_for_function("pgraph.latest.digraph.masses.includes(7)")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    until(lambda: "thigh" in selections(served), "the focus kept over the redraw")

    page.set_viewport_size({"width": 700, "height": 600})  # a narrow window scrolls to it
    served.send(EditBodies(NOBODY, 0, ("arm",), "name", (((), "a long name of an arm"),)))
    for name in ("shank", "trunk"):
        page.evaluate("(body) => pgraph.send('Select', { body })", name)
        page.wait_for_function(INSIDE, arg=name)


INSIDE = """(name) => {
  const picture = document.querySelector("svg.digraph"), sheet = picture.parentElement;
  const of = (el) => el.getBoundingClientRect(), box = of(picture), seen = of(sheet);
  const boxes = [...picture.querySelectorAll("g.node")].map(of);
  const one = picture.querySelector("g.node.selected");
  if (one?.dataset.name !== name) return false;
  const chosen = of(one.querySelector("circle"));
  return boxes.every((one) => one.left >= box.left - 1 && one.right <= box.right + 1)
    && chosen.left >= seen.left && chosen.right <= seen.right;
}"""


def test_the_drawn_tree_has_whole_names_and_stays_within_its_place(page, served):
    long = pg.Model.serial(30).edit("30", name="a_name_of_some_length_in_two_lines")
    opened(page, served, long)
    page.evaluate("pgraph.digraph.toggle(true, false)")
    tree = page.locator("svg.digraph")
    tree.wait_for()
    edges = "(e) => { const { top, bottom } = e.getBoundingClientRect(); return [top, bottom]; }"
    sheet = page.locator(".picture .sheet").evaluate(edges)
    numbers = page.locator('[data-view="digraph"] > h4').evaluate(edges)
    assert tree.bounding_box()["height"] > sheet[1] - sheet[0]  # it scrolls
    assert sheet[1] <= numbers[0] + 1
    lines = node(page, "a_name_of_some_length_in_two_lines").locator("text.label")
    assert "".join(lines.all_text_contents()) == "a_name_of_some_length_in_two_lines"
    page.evaluate("pgraph.digraph.toggle(false, false)")


@pytest.mark.nightly
def test_the_seven_steps_and_a_frame_update_are_stepped_through(page, served):
    page.get_by_role("button", name="How it is built", exact=True).click()
    page.wait_for_selector(".steps .said strong")
    pending = "document.querySelectorAll('.vectors .pending').length"
    assert page.evaluate(pending) == len(served.store.state.derived.pgraph)
    next_ = page.locator(".steps .next")
    while next_.is_enabled() and not page.locator(".steps .place").count():
        next_.click()
    assert page.locator(".steps .place").all_inner_texts() == ["1"]  # the separation body
    page.evaluate("for (let k = 0; k < 40; k++) document.querySelector('.steps .next').click()")
    assert page.evaluate(pending) == 0
    page.evaluate("pgraph.send('StepThrough', { what: 'frames' })")
    page.wait_for_selector(".steps .trace tbody tr")
    page.locator(".steps .trace tbody tr").nth(1).click()
    assert page.locator(".steps tr.now td").all_inner_texts()[3] == "2 3"
    assert page.locator("svg.digraph g.node.carried").count() == 2
    assert page.locator("tr .node.carried").count() == 2
    page.locator(".steps .close").click()
    page.locator(".steps").wait_for(state="hidden")
    for client in served.store.state.clients:
        served.send(StepThrough(client, ""))


def test_sliders_and_cells_pose_the_mechanism(page, served, leg):
    cells = pose_of_all(page)
    until(lambda: cells.count() == 4, "four numbers")
    cells.first.click()
    for text, key in (("-1", "Tab"), (".65", "Enter"), ("2", "ArrowUp")):
        page.keyboard.type(text)
        page.keyboard.press(key)
    wanted = ["-1", "0.65", "2"]
    until(lambda: [cells.nth(i).input_value() for i in range(3)] == wanted, "three numbers")
    assert served.store.state.pose is not None
    assert served.store.state.model == leg
    slider = page.locator('.joint input[type="range"]').nth(2)
    slider.evaluate("e => { e.value = -0.6; e.dispatchEvent(new Event('input')); }")
    until(lambda: cells.nth(2).input_value().startswith("-0.6"), "-0.6 in its cell")
    typed(cells.first, "x")
    refused(page, "trunk", "q")
    served.send(MoveJoint(NOBODY, 0, "arm", 0, "0.25"))
    until(lambda: cells.nth(3).input_value() == "0.25", "its own row")
    cells.first.press("Escape")
    page.locator('[data-view="joints"] button.use').click()
    until(lambda: served.store.state.model.body("shank").q[0] < -0.59, "the initial state")
    assert served.store.state.model.body("trunk").q == (-1.0,)
    served.send(HomePose(NOBODY))

    opened(page, served, leg.edit("thigh", dof=2))
    cells = pose_of_all(page)
    until(lambda: cells.count() == 5, "five numbers")
    choose_body(page, "thigh")
    until(lambda: cells.count() == 2, "those of the body")


def test_marks_gizmo_and_solids_are_drawn_and_cleared(page, served):
    page.get_by_role("button", name="Display").click()
    for what, name in (
        ("names", "/bodies/2/names"), ("links", "/bodies/2/links"), ("coms", "/bodies/2/coms"),
        ("frames", "/bodies/3/frames"), ("inertias", "/inertias"),
    ):  # fmt: skip
        box = page.locator(f'[data-what="{what}"]')
        box.check()
        drawn(page, name)
        box.uncheck()
        drawn(page, name, there=False)
    assert page.locator('[data-what="cones"]').count() == 0  # nothing touches anything

    page.keyboard.press("Escape")
    choose_body(page, "thigh")
    page.get_by_role("button", name="Display").click()
    page.locator("select.gizmo").select_option("com")
    drawn(page, "/grip/control")
    before = served.store.state.model
    page.evaluate(
        """(owner) => {
      const name = "/grip/control", wxyz = [1, 0, 0, 0], send = window.__viserMutable.sendMessage;
      for (let k = 0; k < 20; k++) {
        const position = [0.1 + 0.01 * k, 0, 0];
        send({ type: "TransformControlsUpdateMessage", name, wxyz, position, owner });
      }
      send({ type: "TransformControlsDragEndMessage", name, owner });
    }""",
        str(max(served.viser.get_clients())),
    )
    until(lambda: served.store.state.model is not before, "the drag's end")
    assert served.store.state.model.body("thigh").com == pytest.approx((0.29, 0, 0))
    page.locator("select.gizmo").select_option("")
    drawn(page, "/grip/control", there=False)
    served.send(Undo(NOBODY))
    until(lambda: served.store.state.model is before, "one undo step")

    # what is drawn anew under its name stands as it does now, though viser keeps the pose of a node
    turned = """([name, w]) => w === null ? !window.__viserMutable.nodeRefFromName[name]
      : Math.abs((window.__viserMutable.nodeRefFromName[name]?.quaternion.w ?? 9) - w) < 0.01"""
    for w, event in (
        (0.54, EditBodies(NOBODY, 1, ("thigh",), "q", (((0,), "2"),))),
        (1.0, Undo(NOBODY)),
    ):
        served.send(event)
        for name in ("/selected/0", "/bodies/2"):
            page.wait_for_function(turned, arg=[name, w])
    served.send(EditBodies(NOBODY, 1, ("arm",), "q", (((0,), "2"),)))
    page.wait_for_function(turned, arg=["/bodies/4", 0.54])
    served.send(DeleteBodies(NOBODY, ("arm",), "attach"))
    page.wait_for_function(turned, arg=["/bodies/4", None])
    for _ in range(2):
        served.send(Undo(NOBODY))
    page.wait_for_function(turned, arg=["/bodies/4", float(np.cos(0.6))])


FILL = """() => { const found = [];
  window.__viserMutable.nodeRefFromName["/selected/0/fill"]?.traverse(({ material }) => {
    if (material?.color) found.push(material.color.toArray()); });
  return found.length ? found[0] : null; }"""


def test_a_selected_body_has_the_accent_whichever_was_selected_before(page):
    """It had a paler colour of its own, the palest one in the scene."""
    for name in ("thigh", "arm", "thigh"):
        page.evaluate("(body) => pgraph.send('Select', { body })", name)
        accent = page.evaluate("pgraph.stage.tone('--accent')")
        red, green, blue = (int(accent[k : k + 2], 16) for k in (1, 3, 5))
        assert blue > green > red

        def tinted() -> bool:
            found = page.evaluate(FILL)
            return found is not None and found[2] > 2 * found[1] > 2 * found[0]

        until(tinted, name)


EMISSIVE = """(name) => { let found = null;
  window.__viserMutable.nodeRefFromName[name]?.traverse(({ material }) => {
    if (material?.emissive) found = "#" + material.emissive.getHexString(); });
  return found; }"""


def test_a_spring_is_opened_by_a_click_and_has_the_accent_on_that_page(page, served, leg):
    """Not while bodies are picked: then the click goes through it to what is behind it."""
    beside = {"body": "trunk", "other": "ground", "point": (0, 1, 0), "other_point": (0, 1, 1)}
    opened(page, served, leg.add(pg.Spring(name="bay", stiffness=1, **beside)))
    page.evaluate("pgraph.front('Connections')")
    steady(page, served)
    state = served.store.state
    (end,) = ties.joinings(state, state.derived.positions, np.eye(3)[None].repeat(4, 0))[
        "springs"
    ].at

    def client():
        return served.store.state.clients[client_of(served)]

    def hovered(name: str) -> bool:
        """Over the spring, whose name is at the pointer and whose line in the list is marked."""
        x, y = on_screen(page, end)
        for k in (1, 0):
            page.mouse.move(x + k, y)
            frames(page)
        said = page.evaluate(
            "document.querySelector('.pgraph-pill.hover:not([hidden])')?.textContent ?? ''"
        )
        return said == name

    until(lambda: hovered("bay"), "its name at the pointer")
    assert page.locator(".tie.hovered").get_attribute("data-name") == "bay"
    page.evaluate("pgraph.send('AddPart', { part: 'forces', kind: 'motor', body: null })")
    page.locator(".pgraph-banner").wait_for()
    until(lambda: hovered(""), "no name while a body is picked")
    page.mouse.click(*on_screen(page, end))
    page.evaluate("pgraph.send('Unpick')")
    until(lambda: client().picking is None, "an answer to what came after the click")
    assert client().opened is None
    page.evaluate("pgraph.front('Connections')")
    until(lambda: hovered("bay"), "its name again")
    page.mouse.click(*on_screen(page, end))
    until(lambda: client().opened == ("forces", "bay"), "the open spring")
    drawn(page, "/opened/springs/fill")
    tone = page.evaluate("pgraph.stage.tone('--accent')")
    until(lambda: page.evaluate(EMISSIVE, "/opened/springs/fill") == tone, "the accent")
    assert "/opened/springs/fill" not in served.viser.scene._handle_from_node_name


SEEN_FROM = """([name, up]) => { let sides = [];
  const node = window.__viserMutable.nodeRefFromName[name], above = pgraph.viser.turned(up);
  node?.traverse((one) => { if (!one.material) return;
    const e = one.matrixWorld.elements, y = [e[4], e[5], e[6]];  // its back is towards its y
    const way = y[0] * above[0] + y[1] * above[1] + y[2] * above[2];
    sides.push(one.material.side === 1 && way > 0.9); });
  return sides.length === 1 && sides[0]; }"""


@pytest.mark.nightly
def test_ground_and_camera_follow_the_up_axis(page, served, leg):
    for up, across in (("x", "zy"), ("y", None), ("z", "xy")):
        opened(page, served, leg.replace(up=up))
        camera_ = served.viser.get_clients()[max(served.viser.get_clients())].camera
        axis = "xyz".index(up)
        until(lambda c=camera_, k=axis: abs(c.up_direction[k]) > 0.9, f"{up} up")
        if across:
            scene = served.viser.get_clients()[max(served.viser.get_clients())].scene
            plane = lambda s=scene: s.get_handle_by_name("/floor").plane  # noqa: E731
            until(lambda a=across, p=plane: p() == a, "the floor")
        ask = ["/floor", [float(k == up) for k in "xyz"]]
        until(lambda a=ask: page.evaluate(SEEN_FROM, a), "the floor, seen from above")


# -- the camera ------------------------------------------------------------------------------------


def along(page: Any, way: Any, name: str) -> None:
    way = np.asarray(page.evaluate("(way) => pgraph.viser.turned(way)", list(map(float, way))))
    until(lambda: np.allclose(camera(page)[:3] / distance(page), way, atol=0.01), name)


CLICK = "(it) => document.querySelector(it).dispatchEvent(new Event('click', {bubbles: true}))"


def test_the_fitted_model_lies_beside_the_axes_and_the_tools(page, served):
    opened(page, served, pg.Model.load(pgraph_models.path("four_bar")))
    seen = lambda: np.array([on_screen(page, p) for p in extent(served.store.state)])  # noqa: E731
    axes, tools = (page.locator(one).bounding_box() for one in (".pgraph-views", ".pgraph-tools"))
    for key in ("1", "0"):
        page.keyboard.press(key)
        until(lambda: seen()[:, 0].max() < axes["x"], f"key {key}: left of the axes")
        until(
            lambda: seen()[:, 1].min() > tools["y"] + tools["height"], f"key {key}: below the tools"
        )


def test_named_views_fit_and_centre_by_buttons_keys_and_wheel(page, served):
    page.evaluate("document.activeElement?.blur()")
    views = (
        ("front", "1", (1, 0, 0)), ("side", "2", (0, -1, 0)), ("top", "3", (0, 0, 1)),
        ("isometric", "0", np.array((1, -1, 1)) / 3**0.5),
    )  # fmt: skip
    for k, (_, key, way) in enumerate(views):
        page.keyboard.press(key)
        along(page, way, f"key {key}")
        axis = ("-x", "y", "-z", "x")[k]
        # at once, since the axes are drawn anew while the camera moves
        page.evaluate(CLICK, f'g.axis[data-which="{axis}"]')
        along(page, towards("z", axis), f"from {axis}")
    # what the server heard last of a page's camera may be late: the last view asked for holds
    handle = served.viser.get_clients()[max(served.viser.get_clients())]
    page.keyboard.press("3")
    along(page, (0, 0, 1), "the top")
    seen = lambda: handle.camera.position - handle.camera.look_at  # noqa: E731
    until(lambda: seen()[2] > 0.99 * np.linalg.norm(seen()), "the top heard of")
    heard = handle.camera.position.copy(), handle.camera.look_at.copy()
    page.keyboard.press("0")
    along(page, views[-1][2], "the isometric view")
    handle.camera._state.position, handle.camera._state.look_at = heard
    page.keyboard.press("3")
    along(page, (0, 0, 1), "the top, asked for last")

    far = distance(page)
    choose_body(page, "arm")
    page.evaluate("document.activeElement?.blur()")
    page.keyboard.press("f")
    until(lambda: distance(page) < 0.8 * far, "the arm alone")
    page.keyboard.press("Escape")
    page.locator(".view-fit").click()
    until(lambda: distance(page) > 0.9 * far, "the whole model")

    # it is whole at any size until a person moves the camera, also where it grows by an edit
    for width, height in ((1280, 800), (800, 600), (SIZE["width"], SIZE["height"])):
        page.set_viewport_size({"width": width, "height": height})
        until(lambda: within(page, served), f"all of it at {width} x {height}")
    far = distance(page)
    served.send(EditBodies(NOBODY, 0, ("arm",), "shape_kind", (((), "box"),)))
    served.send(EditBodies(NOBODY, 0, ("arm",), "shape_size", (((0,), "30"), ((1,), "15"))))
    until(lambda: distance(page) > 2 * far, "farther away")
    until(lambda: within(page, served), "the large box")
    served.send(EditBodies(NOBODY, 0, ("arm",), "shape_size", (((0,), "0.1"), ((1,), "0.1"))))
    until(lambda: distance(page) < 2 * far, "nearer again")
    steady(page, served)
    near = distance(page)
    box = page.locator("canvas:not(.pgraph *)").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 3)
    page.mouse.wheel(0, 400)
    until(lambda: served.store.state.clients[client_of(served)].turned, "a person turned it")
    until(lambda: distance(page) > 1.05 * near, "farther by the wheel")
    still = steady(page, served)
    served.send(EditBodies(NOBODY, 0, ("arm",), "shape_size", (((0,), "0.5"),)))
    aspect = served.store.state.clients[client_of(served)].aspect
    page.set_viewport_size({"width": 1100, "height": 700})
    until(lambda: served.store.state.clients[client_of(served)].aspect != aspect, "the new size")
    settled(page, served)
    np.testing.assert_allclose(at_rest(page), still, rtol=1e-3, atol=1e-3)
    page.locator(".view-fit").click()
    until(lambda: not served.store.state.clients[client_of(served)].turned, "framed again")


@pytest.mark.nightly  # by day: its way is that of the middle of the bodies, in test_scene
def test_a_camera_that_follows_keeps_its_offset_and_finds_what_has_left(page, served, compiled):
    """A body that flies along x at 5 m/s for 4 s."""
    start = {"q": (2, 0, 0, 1, 0, 0, 0), "v": (0, 0, 0, 5, 0, 0)}  # away from the origin
    body = pg.Body(name="pelvis", joint="free", inertia=(0.01, 0.01, 0.01), **start, tip=(1, 0, 0))
    opened(page, served, pg.Model(bodies=(body,), gravity=(0, 0, 0), up="y", name="flight"))
    client = client_of(served)
    served.send(SetRun(client, 0, "t_end", "4"))
    served.send(Simulate(client))
    until(lambda: served.store.state.run, "the flight")
    for event in (Pause(client), Scrub(client, 0.0), Show(client, "follow", True)):
        served.send(event)
    at = """(x) => {
      const nodes = Object.entries(__viserMutable.nodeRefFromName); // null where one was removed
      const found = nodes.find(([name, node]) => node && name.startsWith("/along/"));
      return Math.abs(found?.[1].position.x - x) < 1e-5; }"""
    page.wait_for_function(at, arg=0)
    before = steady(page, served)
    page.evaluate("""() => {
      const { nodeRefFromName, camera } = window.__viserMutable;
      window.apart = []; // in each picture: the way from the camera to the body
      pgraph.viser.frame(() => {
        const body = nodeRefFromName["/bodies/1"]?.getWorldPosition(camera.position.clone());
        if (body) window.apart?.push(body.sub(camera.position).toArray());
      });
    }""")
    for k in range(1, 41):
        served.send(Scrub(client, 0.05 * k))
    page.wait_for_function(at, arg=10)
    after = at_rest(page)
    apart = np.array(page.evaluate("[window.apart, (window.apart = null)][0]"))
    np.testing.assert_allclose(apart, apart[:1].repeat(len(apart), axis=0), atol=1e-3)
    np.testing.assert_allclose(after[:3], before[:3], rtol=0.01, atol=1e-4)
    assert np.linalg.norm(after[3:] - before[3:]) == pytest.approx(10, rel=0.01)
    served.send(Show(client, "follow", False))
    served.send(Scrub(client, 4.0))
    page.wait_for_function("pgraph.latest.follow === false")
    served.send(Show(client, "follow", True))
    until(lambda: abs(np.linalg.norm((camera(page) - before)[3:]) - 20) < 2, "where the body is")

    # the picture of the motion and a view come together, as where a panel gets higher
    served.send(Scrub(client, 0.0))
    page.wait_for_function(at, arg=0)
    plain = served.store._update
    served.store._update = lambda s, e: (
        plain(plain(s, e), View(client, "side")) if isinstance(e, Scrub) else plain(s, e)
    )
    try:
        served.send(Scrub(client, 1.0))
        page.wait_for_function(at, arg=5)
    finally:
        served.store._update = plain
    at_rest(page)
    until(lambda: within(page, served), "the body where it is")
    served.send(Scrub(client, 1.6))  # and goes on from there
    page.wait_for_function(at, arg=8)
    at_rest(page)
    until(lambda: within(page, served), "the body where it goes on")
    opened(page, served, pg.Model.serial(2))
    at_rest(page)
    until(lambda: within(page, served), "the next model where it is")


# -- picking and measuring -------------------------------------------------------------------------


def test_a_tip_is_picked_and_two_ends_are_measured_in_the_view(page, served):
    """Corners of two adjacent boxes snap, and the numbers are the model's own."""
    shape = pg.Shape(kind="box", size=(0.2, 0.4, 0.6))
    first = pg.Body(name="a", joint="weld", shape=shape, mass=1.0)
    second = pg.Body(name="b", joint="weld", link=(1, 0, 0), shape=shape, mass=1.0, tip=(0, 0, 0.1))
    opened(page, served, pg.Model(bodies=(first, second), name="boxes"))
    choose_body(page, "b")
    page.evaluate("pgraph.picking.start('point', { field: 'tip', index: [], bodies: ['b'] })")
    said = page.locator(".pgraph-aim")
    said.wait_for()
    page.evaluate("document.activeElement?.blur()")
    page.keyboard.press("0")
    way = np.asarray(TOWARDS[served.store.state.model.up]["isometric"], float)
    along(page, way / np.linalg.norm(way), "the isometric view")
    until(lambda: within(page, served), "both boxes")
    at_rest(page)
    x, y = on_screen(page, (1.1, -0.2, 0.3))
    page.mouse.click(x + 3, y + 2)
    until(lambda: served.store.state.model.body("b").tip == (0.1, -0.2, 0.3), "its corner")
    at_rest(page)
    page.get_by_role("button", name="Measure").click()
    for at, which in (((1.1, -0.2, 0.3), "first"), ((0.1, -0.2, 0.3), "second")):
        said.get_by_text(which).wait_for()
        x, y = on_screen(page, at)
        page.mouse.click(x - 2, y + 3)
    until(lambda: "1 m" in said.inner_text(), "one metre")
    page.keyboard.press("Escape")
    until(lambda: said.count() == 0, "nothing measured any more")
    assert "b" in selections(served)  # Escape ends one thing at a time


@pytest.mark.nightly
def test_a_body_of_a_batch_is_picked(page, served):
    opened(page, served, pg.Model.serial(120))
    drawn(page, "/bodies/capsule")
    drawn(page, "/bodies/1", there=False)
    until(lambda: within(page, served), "all of it")
    steady(page, served)
    page.mouse.click(*on_screen(page, middle_of(served, "60")))
    page.wait_for_function("pgraph.latest.selection")
    assert abs(int(page.evaluate("pgraph.latest.selection")) - 60) <= 1  # its neighbours overlap


def test_a_body_under_the_pointer_is_lit_in_all_views_and_dragging_it_poses_it(
    page, served, compiled
):
    """Hover in 3D and in the table name the same body; a drag moves its joints, in one pose."""
    page.evaluate("document.activeElement?.blur()")
    page.keyboard.press("1")
    until(lambda: within(page, served), "the model")
    steady(page, served)
    lit = """(name) => {
      const number = pgraph.latest.digraph.names.indexOf(name) + 1;
      let on = false;
      window.__viserMutable.nodeRefFromName[`/bodies/${number}`].traverse(({ material }) => {
        on ||= Boolean(material?.emissive?.getHex()); });
      const rows = [...document.querySelectorAll("tr.hovered")].map((tr) => tr.dataset.name);
      return on && rows.join() === name; }"""
    place = on_screen(page, middle_of(served, "arm"))
    page.mouse.move(*place)
    page.wait_for_function(lit, arg="arm")
    assert page.locator(".pgraph-pill.hover").inner_text() == "arm"
    before = served.store.state.model
    page.mouse.down()
    for k in range(50):
        page.mouse.move(place[0] + 25, place[1] + 20 + k % 5, steps=2)
        if served.store.state.pose is not None:
            break
    page.mouse.up()
    until(lambda: served.store.state.pose is not None, "a pose by hand")
    assert served.store.state.model is before
    served.send(HomePose(NOBODY))
    page.locator('tr[data-name="shank"] td.number').hover()
    page.wait_for_function(lit, arg="shank")
    assert page.locator(".pgraph-pill.hover").is_hidden()

    settled(page, served)  # the home pose is drawn
    page.keyboard.press("2")  # a hand that misses the body turns the view
    steady(page, served)
    far = distance(page)  # a double click frames the body, or on nothing all
    page.mouse.dblclick(*on_screen(page, middle_of(served, "arm")))
    until(lambda: "arm" in selections(served) and distance(page) < 0.8 * far, "the arm alone")
    at_rest(page)
    box = page.locator("canvas:not(.pgraph *)").first.bounding_box()
    page.mouse.dblclick(box["x"] + 5, box["y"] + box["height"] / 2)
    until(lambda: "arm" not in selections(served) and distance(page) > 0.9 * far, "all")


def test_a_touch_screen_selects_orbits_drags_and_plays(browser, page, served, compiled):
    """One finger taps a body, turns the view beside it and drags it; a tap on Play computes."""
    context = browser.new_context(viewport=SIZE, has_touch=True, **MOTION)
    context.add_init_script(UNDRAWN)
    context.set_default_timeout(1000 * LIMIT)
    touched = context.new_page()
    touched.goto(served.url)
    touched.wait_for_selector("#pgraph-loading", state="detached")
    fingers = context.new_cdp_session(touched)

    def swipe(x: float, y: float, right: float, down: float) -> None:
        places = [{"x": x + right * k / 5, "y": y + down * k / 5} for k in range(6)]
        for kind, at in zip(("touchStart", *["touchMove"] * 5), places):
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
            touched.evaluate("new Promise(requestAnimationFrame)")  # a picture for each move
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    until(lambda: within(touched, served), "the model")
    steady(touched, served)
    touched.touchscreen.tap(*on_screen(touched, middle_of(served, "arm")))
    touched.wait_for_function("pgraph.latest.selection === 'arm'")
    before = at_rest(touched)
    box = touched.locator("canvas:not(.pgraph *)").first.bounding_box()
    assert (
        touched.evaluate("getComputedStyle(document.getElementById('root')).touchAction") == "none"
    )
    swipe(box["x"] + 0.8 * box["width"], box["y"] + 0.8 * box["height"], -100, -50)
    until(lambda: np.linalg.norm(camera(touched) - before) > 0.01, "another view")
    at_rest(touched)
    swipe(*on_screen(touched, middle_of(served, "arm")), 30, 20)
    until(lambda: served.store.state.pose is not None, "a pose by hand")
    run = served.store.state.last_run
    touched.locator("button.play").tap()
    until(lambda: served.store.state.last_run is not run, "a run")
    context.close()


def test_instances_placed_after_the_last_picture_are_drawn(page: Any, served: Server):
    """Viser places the instances of a solid after it is in the scene, however slow pictures are."""
    settled(page, served)
    page.wait_for_function("window.__viserMutable.nodeRefFromName['/joining/pivots']")
    page.evaluate(  # the clock stands, long after the last request and before a picture at rest
        """() => {
      const later = performance.now() + 5000;
      performance.now = () => later;
      __viserMutable.nodeRefFromName['/joining/pivots'].traverse((one) => {
        if (one.matricesTexture) (window.placed = one.matricesTexture).enqueueUpdate(0);
      }); }"""
    )
    try:
        page.wait_for_function("!placed._needsUpdate")
    finally:
        page.evaluate("delete performance.now")
