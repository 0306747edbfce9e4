"""The digraph, the 3D view and the Operators tab in a browser; each test names what it proves.

Numbers are lines of the interface (sec. 4.1 of the paper, D1-D18 of its checklist).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.digraph.update import StepThrough
from pgraph_app.model.update import Edit, OpenText, Undo
from pgraph_app.playback.update import Pause, Scrub
from pgraph_app.pose.update import HomePose, MoveJoint
from pgraph_app.properties.update import EditBodies
from pgraph_app.run.update import SetRun, Simulate
from pgraph_app.scene.camera import extent
from pgraph_app.scene.update import Show, View
from pgraph_app.table.update import DeleteBodies

from .conftest import NOBODY, last_step, steps_after, until
from .test_page import place, row


def node(page: Any, name: str) -> Any:
    return page.locator(f'svg.digraph g.node[data-name="{name}"]')


def circle(page: Any, name: str) -> tuple[float, float]:
    """Where the circle of a node is on the page."""
    at = node(page, name).locator("circle").last
    box = until(lambda: at.bounding_box(), f"{name} in the digraph")
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page: Any, name: str, to: str, *, shift: bool = False) -> str:
    """Drag one node onto another; the sentence that is read before it is dropped."""
    page.mouse.move(*circle(page, name))
    page.mouse.down()
    page.mouse.move(*circle(page, to), steps=4)
    if shift:
        page.keyboard.down("Shift")
        page.mouse.move(*circle(page, to))
    said = page.locator(".drag-hint").inner_text()
    page.mouse.up()
    page.keyboard.up("Shift")
    return said


def lit(page: Any, what: str) -> list[str]:
    """Names of the bodies whose entries of Pgraph have a mark, each once."""
    return page.evaluate(
        """(what) => [...new Set([...document.querySelectorAll(`.vectors .${what}`)]
           .map((e) => e.dataset.name))]""",
        what,
    )


# -- the digraph -------------------------------------------------------------------------------


def test_d7_a_node_dragged_onto_another_changes_its_parent_as_one_undo_step(page, served):
    last = last_step(served)
    said = drag(page, "left_femur", "thorax")
    assert "thorax becomes the parent of left_femur" in said
    until(lambda: served.store.state.model.body("left_femur").parent == "thorax", "the new parent")
    assert steps_after(last, served) == 1


def test_d7_descendants_are_not_offered_and_a_refused_drop_says_why(page, served):
    before = served.store.state.model
    said = drag(page, "left_femur", "left_tibia")
    assert "left_tibia hangs on left_femur" in said
    page.locator(".pgraph-toast", has_text="closes a cycle").wait_for()
    assert served.store.state.model is before
    page.evaluate("document.querySelectorAll('.pgraph-toast').forEach((e) => e.remove())")


def test_d15_dropped_with_shift_it_gets_a_second_parent_and_a_dashed_loop_edge(page, served):
    drag(page, "left_tibia", "right_tibia", shift=True)
    until(lambda: len(served.store.state.model.constraints) == 5, "the cut joint")
    page.wait_for_selector('svg.digraph g.loop[data-loop="left_tibia-right_tibia"] path.line')
    dashed = page.evaluate(
        "getComputedStyle(document.querySelector('.loop path.line')).strokeDasharray"
    )
    assert dashed != "none"


def test_hover_shows_name_joint_and_mass_and_marks_the_path_to_the_root(page):
    page.mouse.move(*circle(page, "left_tibia"))
    card = page.locator(".card")
    card.wait_for()
    for part in ("left_tibia", "revolute joint to left_femur", "0.9 kg"):
        assert part in card.inner_text()
    assert set(lit(page, "path")) == {"pelvis", "left_femur", "left_tibia"}
    page.mouse.move(600, 300)
    card.wait_for(state="hidden")


def test_arrows_move_along_the_tree_and_enter_selects(page, served):
    node(page, "pelvis").focus()
    for key in ("ArrowDown", "ArrowRight", "ArrowDown"):  # lumbar, left_femur, left_tibia
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    until(lambda: "left_tibia" in selections(served), "left_tibia selected")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    until(lambda: "left_femur" in selections(served), "left_femur selected")
    served.send(Edit(NOBODY, 0, "thorax", "mass", (), "7"))  # somebody else's: drawn anew
    until(lambda: page.evaluate("pgraph.latest.digraph") and served.store.state.undo, "the edit")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    until(lambda: "pelvis" in selections(served), "the focus kept over the redraw")


def selections(served: Any) -> list[str | None]:
    return [client.selection for client in served.store.state.clients.values()]


def test_d10_step_through_grows_pgraph_with_its_stack_to_the_same_vector(page, served):
    page.get_by_role("button", name="Step through").click()
    page.wait_for_selector(".steps .said strong")
    pending = "document.querySelectorAll('.vectors .pending').length"
    assert page.evaluate(pending) == len(served.store.state.derived.pgraph)
    for _ in range(9):
        page.locator(".steps .next").click()
    assert "4 is a separation body" in page.locator(".steps .said").inner_text()
    assert page.locator(".steps .place").all_inner_texts() == ["1", "4"]
    page.evaluate("for (let k = 0; k < 40; k++) document.querySelector('.steps .next').click()")
    assert page.evaluate(pending) == 0
    assert "the end" in page.locator(".steps .said").inner_text()


def test_c7_the_trace_of_a_frame_update_marks_what_each_joint_carries(page):
    page.evaluate("pgraph.send('StepThrough', { what: 'frames' })")
    page.wait_for_selector(".steps .trace tbody tr")
    page.locator(".steps .trace tbody tr").nth(3).click()
    assert page.locator(".steps tr.now td").all_inner_texts()[:4] == [
        "4", "4", "4", "4 5 6 7 8 9 10"
    ]  # fmt: skip
    assert page.locator("svg.digraph g.node.carried").count() == 7
    page.locator(".steps .close").click()
    page.locator(".steps").wait_for(state="hidden")


@pytest.fixture(autouse=True)
def _nobody_steps(page, served):
    yield
    for client in served.store.state.clients:
        served.send(StepThrough(client, ""))
    served.send(HomePose(NOBODY))


# -- the 3D view -------------------------------------------------------------------------------


def drawn(page: Any, name: str) -> bool:
    """The 3D view has such a node."""
    return page.evaluate("(name) => name in window.__viserSceneTree.getState()", name)


def test_a_slider_poses_the_mechanism_and_use_as_initial_state_keeps_it(page, served):
    page.get_by_role("tab", name="Pose").click()
    cell = page.get_by_label("left_femur about z in rad")
    cell.fill("0.4")
    cell.press("Enter")
    until(lambda: served.store.state.pose is not None, "a pose by hand")
    assert served.store.state.model.body("left_femur").q == (0.0,)
    slider = page.get_by_label("left_tibia about z", exact=True)
    slider.evaluate("e => { e.value = -0.6; e.dispatchEvent(new Event('input')); }")
    until(lambda: "-0.6" in page.get_by_label("left_tibia about z in rad").input_value(), "-0.6")
    page.get_by_role("button", name="Use as initial state").click()
    until(lambda: served.store.state.model.body("left_tibia").q[0] < -0.59, "the initial state")
    page.get_by_role("tab", name="Properties").click()


def test_no_slider_of_another_model_is_ever_there(page, served, quadruped):
    """The page is told of joints while it shows them: what stood there before is gone."""
    page.get_by_role("tab", name="Pose").click()
    page.get_by_label("left_femur about z in rad").wait_for()
    page.get_by_role("tab", name="Properties").click()
    page.locator(".joint").first.wait_for(state="detached")
    two = quadruped.edit("left_femur", dof=2)
    served.send(OpenText(NOBODY, "two", two.to_json()))
    page.get_by_role("tab", name="Pose").click()
    page.get_by_label("left_femur about y in rad").wait_for()
    page.get_by_role("tab", name="Properties").click()
    page.locator(".joint").first.wait_for(state="detached")


def test_the_gizmo_moves_the_selected_body_as_one_undo_step_at_release(page, served):
    page.locator('tr[data-name="thorax"] td.number').click()
    page.get_by_role("tab", name="Show").click()
    page.locator("select.gizmo").select_option("com")
    until(lambda: drawn(page, "/grip/control"), "the gizmo")
    last = last_step(served)
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
    until(lambda: steps_after(last, served) == 1, "one undo step")
    assert served.store.state.model.body("thorax").com == pytest.approx((0.29, 0, 0))
    page.locator("select.gizmo").select_option("")
    until(lambda: not drawn(page, "/grip/control"), "no gizmo")


def test_each_kind_of_mark_has_a_switch_that_draws_and_clears_it(page, served):
    page.get_by_role("tab", name="Show").click()
    for what, name in (
        ("frames", "/bodies/3/frames"), ("inertias", "/inertias"), ("points", "/bodies/7/points"),
    ):  # fmt: skip
        box = page.locator(f'[data-what="{what}"]')
        box.check()
        until(lambda name=name: drawn(page, name), f"{what} in 3D")
        box.uncheck()
        until(lambda name=name: not drawn(page, name), f"no {what} in 3D")
    assert page.locator('[data-what="cones"]').count() == 1  # its feet touch where it walks
    served.send(OpenText(NOBODY, "rods", pg.Model.serial(2).to_json()))
    gone = page.locator('[data-what="cones"]')
    until(lambda: gone.count() == 0, "no switch for cones where nothing touches")


@pytest.mark.parametrize("up", ["x", "z"])
def test_the_ground_and_the_camera_follow_the_up_axis(page, served, up):
    model = served.store.state.model.replace(up=up)
    served.send(OpenText(NOBODY, "turned", model.to_json()))
    client = max(served.viser.get_clients())
    camera = served.viser.get_clients()[client].camera
    axis = "xyz".index(up)
    until(lambda: abs(camera.up_direction[axis]) > 0.9, f"{up} up")
    scene, across = served.viser.scene, {"x": "zy", "z": "xy"}[up]
    until(lambda: scene.get_handle_by_name("/ground").plane == across, "the ground across it")


SEEN_FROM = """([name, up]) => { let sides = [];
  const node = window.__viserMutable.nodeRefFromName[name], above = pgraph.viser.turned(up);
  node?.traverse((one) => { if (!one.material) return;
    const e = one.matrixWorld.elements, y = [e[4], e[5], e[6]];  // its back is towards its y
    const way = y[0] * above[0] + y[1] * above[1] + y[2] * above[2];
    sides.push([one.material.side, way > 0.9]); });
  return sides; }"""


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_floor_is_drawn_from_above_alone(page, served, up):
    served.send(OpenText(NOBODY, "turned", pg.Model.serial(2).replace(up=up).to_json()))
    axis = [float(k == up) for k in "xyz"]
    for name in ("/floor", "/ground"):
        seen = lambda name=name: page.evaluate(SEEN_FROM, [name, axis])  # noqa: E731
        until(lambda seen=seen: seen() == [[1, True]], f"{name}: its back, which is above")


def test_arrows_are_drawn_over_the_bodies_that_they_act_on(page, served):
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    scenario = model.scenarios[0].model_copy(update={"t_end": 0.01})
    served.send(OpenText(NOBODY, "stance", model.replace(scenarios=(scenario,)).to_json()))
    until(lambda: served.store.state.model.name == model.name, "the quadruped")
    page.get_by_role("tab", name="Show").click()
    page.locator('[data-what="forces"]').check()
    page.get_by_role("button", name="Simulate", exact=True).click()
    over = """() => { const found = [];
      window.__viserMutable.nodeRefFromName["/forces"]?.traverse(({ material }) => {
        if (material) found.push([material.depthTest, material.transparent]); });
      return found.length > 1 && found.every(([tests, last]) => !tests && last); }"""
    until(lambda: page.evaluate(over), "arrows that no body hides", seconds=90)


# -- the Operators tab -------------------------------------------------------------------------


def test_d11_operators_are_viewable_with_the_value_under_the_pointer(page, served):
    page.get_by_role("tab", name="Operators").click()
    value = page.locator('[data-view="operators"] .value')
    until(lambda: "21 × 21" in value.inner_text(), "the mass matrix")
    page.locator("canvas.cells").hover(position={"x": 3, "y": 3})
    until(lambda: "M[pelvis 1, pelvis 1] =" in value.inner_text(), "its first entry")
    page.get_by_label("operator", exact=True).select_option("S")
    until(lambda: "16 × 16" in value.inner_text(), "the adjacency")
    page.get_by_role("tab", name="Digraph").click()
    idle = lambda: all(c.inspected is None for c in served.store.state.clients.values())  # noqa: E731
    until(idle, "nothing computed out of view")


def test_what_is_drawn_anew_under_its_name_stands_as_it_does_now(page, served):
    """viser keeps the pose of a node that was removed, and does not say one that is the default."""
    turn = "(name) => window.__viserMutable.nodeRefFromName[name]?.quaternion.w ?? null"

    def turned(name: str, w: float) -> bool:
        """While a node is made again it is not there."""
        now = page.evaluate(turn, name)
        return now is not None and abs(now - w) < 0.01

    row(page, "left_femur").locator("td.number").click()
    until(lambda: place(page, "/selected"), "its outline")
    for w, event in ((0.54, Edit(NOBODY, 1, "left_femur", "q", (0,), "2")),
                     (1.0, Undo(NOBODY))):  # fmt: skip
        served.send(event)
        for name in ("/selected", "/bodies/11"):
            until(lambda n=name, w=w: turned(n, w), f"{name} at {w}")
    served.send(Edit(NOBODY, 1, "right_hind_paw", "q", (0,), "2"))
    until(lambda: turned("/bodies/16", 0.54), "the last body turned")
    served.send(DeleteBodies(NOBODY, ("right_hind_paw",), "attach"))
    until(lambda: page.evaluate(turn, "/bodies/16") is None, "the last body gone")
    served.send(Undo(NOBODY))
    served.send(Undo(NOBODY))
    until(lambda: page.evaluate(turn, "/bodies/16") == 1.0, "the last body as it was")


def test_a_refused_coordinate_leaves_the_others_in_their_rows(page, served):
    """The sentence stands between the rows."""
    page.evaluate("() => pgraph.front('Pose')")
    cells = page.locator(".joint .cell")
    cells.first.wait_for()
    cells.first.fill("x")
    cells.first.press("Enter")
    page.get_by_text("body 'pelvis', q: must be a number").wait_for()
    served.send(MoveJoint(NOBODY, 0, "left_tibia", 0, "0.25"))
    cell = page.get_by_label("left_tibia about z in rad")
    until(lambda: cell.input_value() == "0.25", "its own row")
    cells.first.press("Escape")
    served.send(HomePose(NOBODY))
    page.evaluate("() => pgraph.front('Properties')")


def offset(page: Any) -> list[float]:
    """From what the page's own camera looks at to the camera, in three.js's axes."""
    return page.evaluate(
        """() => { const c = window.__viserMutable.cameraControl, a = c.camera.position.clone();
           const b = a.clone(); c.getPosition(a, true); c.getTarget(b, true);
           return [a.x - b.x, a.y - b.y, a.z - b.z, b.x, b.y, b.z]; }"""
    )


def test_named_views_by_button_and_by_key_look_along_the_axes(page, served):
    def along() -> np.ndarray:
        way = np.asarray(offset(page)[:3])
        return way / np.linalg.norm(way)

    for name, key, way in (
        ("View from front", "1", (1, 0, 0)), ("View from the side", "2", (0, 0, 1)),
        ("View from the top", "3", (0, 1, 0)), ("Isometric view", "0", np.ones(3) / 3**0.5),
    ):  # fmt: skip
        way = page.evaluate("(way) => pgraph.viser.turned(way)", list(way))  # in three.js's axes
        page.get_by_role("button", name=name).click()
        until(lambda way=way: np.allclose(along(), way, atol=0.01), name)
        page.keyboard.press("0" if key != "0" else "1")
        until(lambda way=way: not np.allclose(along(), way, atol=0.01), "another view")
        page.keyboard.press(key)
        until(lambda way=way: np.allclose(along(), way, atol=0.01), f"{name} by key {key}")
    # What the server heard last of a page's camera may be late: the last view asked for holds.
    handle = served.viser.get_clients()[max(served.viser.get_clients())]
    top = page.evaluate("(way) => pgraph.viser.turned(way)", [0, 1, 0])
    page.keyboard.press("3")
    until(lambda: np.allclose(along(), top, atol=0.01), "the view from the top")
    until(lambda: abs(handle.camera.position[1] - handle.camera.look_at[1]) > 0.1, "heard of")
    late = handle.camera.position.copy(), handle.camera.look_at.copy()
    page.keyboard.press("0")
    until(lambda: not np.allclose(along(), top, atol=0.01), "the isometric view")
    handle.camera._state.position, handle.camera._state.look_at = late
    page.keyboard.press("3")
    until(lambda: np.allclose(along(), top, atol=0.01), "the view from the top, asked for last")
    far = np.linalg.norm(offset(page)[:3])
    row(page, "left_hind_paw").locator("td.number").click()
    page.evaluate("document.activeElement?.blur()")
    page.keyboard.press("f")
    until(lambda: np.linalg.norm(offset(page)[:3]) < far / 2, "the paw alone")
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Fit view").click()
    until(lambda: np.linalg.norm(offset(page)[:3]) > 0.8 * far, "the whole animal")


def test_a_camera_that_follows_keeps_its_offset_and_finds_what_has_left(page, served):
    """A body that flies along x at 5 m/s for 4 s."""
    body = pg.Body(name="pelvis", joint="free", v=(0, 0, 0, 5, 0, 0), tip=(1, 0, 0))
    flight = pg.Model(bodies=(body,), gravity=(0, 0, 0), up="y")
    client = max(served.viser.get_clients())
    served.send(OpenText(NOBODY, "flight", flight.to_json()))
    served.send(SetRun(client, 0, "t_end", "4"))
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    served.send(Simulate(client))
    until(lambda: served.store.state.run, "the flight")
    served.send(Pause(client))
    served.send(Scrub(client, 0.0))
    served.send(Show(client, "follow", True))
    until(lambda: page.evaluate("pgraph.latest.follow") == [0, 0, 0], "where it goes along to")
    page.wait_for_timeout(300)  # the camera's last move arrives
    before = offset(page)
    for k in range(1, 41):
        served.send(Scrub(client, 0.05 * k))
    until(lambda: abs(page.evaluate("pgraph.latest.follow[0]") - 10) < 1e-5, "the last place")
    after = offset(page)
    np.testing.assert_allclose(after[:3], before[:3], rtol=0.01, atol=1e-4)
    assert np.linalg.norm(np.subtract(after, before)[3:]) == pytest.approx(10, rel=0.01)
    served.send(Show(client, "follow", False))
    served.send(Scrub(client, 4.0))
    until(lambda: page.evaluate("pgraph.latest.follow.length") == 0, "a camera that stays")
    served.send(Show(client, "follow", True))
    found = lambda: np.linalg.norm(np.subtract(offset(page), before)[3:])  # noqa: E731
    until(lambda: abs(found() - 20) < 2, "the camera where the body is")
    served.send(Show(client, "follow", False))


def test_a_camera_that_is_set_anew_while_it_follows_is_where_the_body_is(page, served):
    """The picture of the motion and the view come together, as where a panel gets higher."""
    body = pg.Body(name="pelvis", joint="free", v=(0, 0, 0, 5, 0, 0), tip=(1, 0, 0))
    flight = pg.Model(bodies=(body,), gravity=(0, 0, 0), up="y")
    client = max(served.viser.get_clients())
    served.send(OpenText(NOBODY, "flight", flight.to_json()))
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    served.send(Simulate(client))
    until(lambda: served.store.state.run, "the flight")
    served.send(Pause(client))
    served.send(Scrub(client, 0.0))
    served.send(Show(client, "follow", True))
    until(lambda: page.evaluate("pgraph.latest.follow") == [0, 0, 0], "where it goes along to")
    plain = served.store._update
    served.store._update = lambda s, e: (
        plain(plain(s, e), View(client, "side")) if isinstance(e, Scrub) else plain(s, e)
    )
    try:
        served.send(Scrub(client, 1.0))
        until(lambda: page.evaluate("pgraph.latest.follow[0]") == 5, "the body's place")
    finally:
        served.store._update = plain
    page.wait_for_timeout(500)
    assert within(page, served)
    served.send(Scrub(client, 1.6))  # and goes on from there
    until(lambda: page.evaluate("pgraph.latest.follow[0]") == 8, "the next place")
    page.wait_for_timeout(500)
    assert within(page, served)
    served.send(Show(client, "follow", False))


# -- framing, picking, measuring, menus ------------------------------------------------------------


def within(page: Any, served: Any) -> bool:
    """Whether all that is drawn of the model is in the 3D view, and not under the playback."""
    places = page.evaluate(
        """(points) => {
           const box = (what) => document.querySelector(what).getBoundingClientRect();
           const view = box('canvas:not(.pgraph *)'), bar = box('[data-floating-window]');
           return points.map((p) => { const [x, y] = pgraph.picking.projected(p) ?? [-1, -1];
             return x >= view.left && x <= view.right && y >= view.top && y <= bar.top; }); }""",
        extent(served.store.state).tolist(),
    )  # fmt: skip
    return all(places)


def test_the_model_is_whole_at_any_size_of_the_window_until_a_person_moves_the_camera(page, served):
    before = page.viewport_size
    for width, height in ((1920, 1080), (900, 800), (1280, 800)):
        page.set_viewport_size({"width": width, "height": height})
        until(lambda: within(page, served), f"all of it at {width} x {height}")
    far = np.linalg.norm(at_rest(page)[:3])
    box = page.locator("canvas:not(.pgraph *)").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.wheel(0, 400)
    until(lambda: np.linalg.norm(offset(page)[:3]) > 1.05 * far, "farther by the wheel")
    chosen = at_rest(page)
    page.set_viewport_size({"width": 1500, "height": 900})
    client = max(served.viser.get_clients())
    until(lambda: served.store.state.clients[client].window == 1500, "the new size told")
    np.testing.assert_allclose(at_rest(page), chosen, rtol=1e-3, atol=1e-3)
    page.set_viewport_size(before)
    page.get_by_role("button", name="Fit view").click()


def test_a_model_that_grows_by_an_edit_is_seen_whole(page, served):
    """A box that takes in the camera, and one that shrinks; until a person turns the view."""
    served.send(OpenText(NOBODY, "two", pg.Model.serial(2).to_json()))
    until(lambda: within(page, served), "two bodies")
    served.send(EditBodies(NOBODY, 0, ("1",), "shape_kind", (((), "box"),)))
    far = np.linalg.norm(at_rest(page)[:3])
    served.send(EditBodies(NOBODY, 0, ("1",), "shape_size", (((0,), "8"), ((1,), "4"))))
    until(lambda: np.linalg.norm(offset(page)[:3]) > 2 * far, "farther away")
    until(lambda: within(page, served), "the large box")
    served.send(EditBodies(NOBODY, 0, ("1",), "shape_size", (((0,), "0.1"), ((1,), "0.1"))))
    until(lambda: np.linalg.norm(offset(page)[:3]) < 2 * far, "nearer again")
    box = page.locator("canvas:not(.pgraph *)").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 3)
    page.mouse.wheel(0, 200)
    client = max(served.viser.get_clients())
    until(lambda: served.store.state.clients[client].turned, "told that a person turned it")
    chosen = at_rest(page)
    served.send(EditBodies(NOBODY, 0, ("1",), "shape_size", (((0,), "0.12"),)))
    np.testing.assert_allclose(at_rest(page), chosen, rtol=1e-3, atol=1e-3)
    page.get_by_role("button", name="Fit view").click()
    until(lambda: not served.store.state.clients[client].turned, "told that it is framed again")


INSIDE = """() => {
  const picture = document.querySelector("svg.digraph"), sheet = picture.parentElement;
  const of = (el) => el.getBoundingClientRect(), box = of(picture), seen = of(sheet);
  const boxes = [...picture.querySelectorAll("g.node")].map(of);
  const chosen = of(picture.querySelector("g.node.selected circle"));
  return [boxes.every((one) => one.left >= box.left - 1 && one.right <= box.right + 1),
    chosen.left >= seen.left && chosen.right <= seen.right, getComputedStyle(sheet).overflowX];
}"""


def test_the_digraph_of_a_narrow_window_is_scrolled_to_and_not_cut_off(page, served):
    page.evaluate("() => pgraph.front('Digraph')")
    before = page.viewport_size
    page.set_viewport_size({"width": 900, "height": 800})
    for name in ("right_hind_paw", "left_front_paw"):
        page.evaluate("(body) => pgraph.send('Select', { body })", name)
        page.locator("svg.digraph g.node.selected").wait_for()
        until(lambda: page.evaluate(INSIDE) == [True, True, "auto"], f"{name} in sight")
    page.set_viewport_size(before)


def test_tab_enter_and_arrows_go_from_number_to_number_of_a_pose(page, served):
    served.send(OpenText(NOBODY, "three", pg.Model.serial(3).to_json()))
    page.evaluate("() => pgraph.front('Pose')")
    cells = page.locator(".joint .cell")
    until(lambda: cells.count() == 3, "three numbers")
    cells.first.click()
    for text, key in (("-1", "Tab"), (".65", "Enter"), ("2", "ArrowUp")):
        page.keyboard.type(text)
        page.keyboard.press(key)
    typed = ["-1", "0.65", "2"]
    until(lambda: [cells.nth(i).input_value() for i in range(3)] == typed, "three numbers")
    served.send(HomePose(NOBODY))
    page.evaluate("() => pgraph.front('Properties')")


def at_rest(page: Any) -> list[float]:
    """Where the camera is once it has not moved for a second."""
    seen = [offset(page)]

    def still() -> bool:
        page.wait_for_timeout(1000)
        seen.append(offset(page))
        return np.allclose(seen[-1], seen[-2], rtol=1e-4, atol=1e-4)

    until(still, "a camera at rest")
    return seen[-1]


def on_page(page: Any, point: Any) -> tuple[float, float]:
    return tuple(page.evaluate("(p) => pgraph.picking.projected(p)", np.asarray(point).tolist()))


def test_a_tip_is_picked_and_two_ends_are_measured_in_the_view(page, served):
    """Two boxes side by side: corners snap; the numbers are the model's own."""
    shape = pg.Shape(kind="box", size=(0.2, 0.4, 0.6))
    first = pg.Body(name="a", joint="weld", shape=shape, mass=1.0)
    second = pg.Body(name="b", joint="weld", link=(1, 0, 0), shape=shape, mass=1.0, tip=(0, 0, 0.1))
    served.send(OpenText(NOBODY, "boxes", pg.Model(bodies=(first, second)).to_json()))
    row(page, "b").locator("td.number").click()
    page.get_by_role("button", name="pick Tip in 3D").click()
    page.locator(".pgraph-aim").wait_for()
    page.get_by_role("button", name="View from front").click()
    page.get_by_role("button", name="Isometric view").click()
    until(lambda: within(page, served), "both boxes")
    at_rest(page)
    x, y = on_page(page, (1.1, -0.2, 0.3))
    page.mouse.click(x + 3, y + 2)
    until(lambda: served.store.state.model.body("b").tip == (0.1, -0.2, 0.3), "its corner")
    page.get_by_role("button", name="Measure").click()
    said = page.locator(".pgraph-aim")
    for at, next_ in (((1.1, -0.2, 0.3), "first"), ((0.1, -0.2, 0.3), "second")):
        said.get_by_text(next_).wait_for()
        x, y = on_page(page, at)
        page.mouse.click(x - 2, y + 3)
    until(lambda: "distance 1 m" in said.inner_text(), "one metre")
    page.keyboard.press("Escape")
    until(lambda: said.count() == 0, "nothing measured any more")
    assert "b" in selections(served)  # Escape ends one thing at a time


def test_rows_nodes_and_bodies_have_a_menu_and_f6_goes_from_pane_to_pane(page, served):
    row(page, "left_tibia").locator("td.number").click(button="right")
    menu = page.get_by_role("menu", name="commands for left_tibia")
    menu.get_by_role("menuitem", name="Add a body on it").click()
    until(lambda: len(served.store.state.model.bodies) == 17, "a body more")
    assert served.store.state.model.bodies[-1].parent == "left_tibia"
    served.send(Undo(NOBODY))
    node(page, "left_femur").click(button="right")
    menu = page.get_by_role("menu", name="commands for left_femur")
    menu.wait_for()
    page.keyboard.press("Escape")
    until(lambda: menu.count() == 0, "no menu")
    x, y = on_page(page, middle_of(served, "thorax"))
    page.mouse.click(x, y, button="right")
    page.get_by_role("menu").wait_for()
    page.keyboard.press("Escape")
    before = set(served.store.state.clients)
    served.viser._websock_server.disconnect_all_clients()
    until(lambda: set(served.store.state.clients) - before, "the page to come back")
    page.wait_for_function("pgraph.latest?.properties")
    page.wait_for_timeout(500)
    assert page.get_by_role("menu").count() == 0
    seen = []
    for _ in range(6):
        page.keyboard.press("F6")
        seen.append(
            page.evaluate("document.activeElement.closest('[data-view]')?.dataset.view ?? 'view'")
        )
    assert len(set(seen)) == 6, seen


def middle_of(served: Any, name: str) -> np.ndarray:
    state = served.store.state
    corners = extent(state, (name,))
    return (corners.min(axis=0) + corners.max(axis=0)) / 2
