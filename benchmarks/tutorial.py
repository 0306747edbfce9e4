"""What a person does on the page, by clicks and keys: docs/tutorial.md, a URDF with a loop, an arm.

From New to a simulated four-bar; from a zip of a URDF with its meshes, through the loop that
URDF cannot hold, to the run and back to a file; from New to a six-axis arm that picks up a box.

The seconds are those of the keystroke-level model [Card, Moran, Newell 1980]: a key, a click after
pointing, and a thought before each step. Nothing here waits for them.
"""

from __future__ import annotations

import base64
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import trimesh

KEY, CLICK, THOUGHT = 0.2, 1.3, 1.35  # [s] a key; point (1.1) and press (0.2); before each step
DRAG, READ = 2.6, 3.0  # [s] point, press, point, release; ten words at 200 a minute
ROW_OF_FOCUS = "(name) => document.activeElement.closest('tr')?.dataset.name === name"


@dataclass
class Person:
    """Clicks and keys on a page, and the time that a person would take."""

    page: Any
    seconds: float = 0.0
    clicks: int = 0
    keys: int = 0  # with those held down, as Control

    def think(self) -> None:
        self.seconds += THOUGHT

    def click(self, what: str, *, holding: str = "") -> None:
        held: Any = [holding] if holding else None
        self.page.locator(what).first.click(modifiers=held)
        self._spent(1, len(holding) > 0)

    def choose(self, what: str, value: str) -> None:
        """From a drop-down: a click opens it, another takes the entry."""
        self.page.locator(what).first.focus()  # it is filled when it is opened
        self.page.locator(what).first.select_option(value)
        self._spent(2, 0)

    def press(self, keys: str) -> None:
        """A key, or several at once: Control+Enter."""
        self.page.keyboard.press(keys)
        self._spent(0, len(keys.split("+")))

    def write(self, text: str, *, then: str = "Enter") -> None:
        """Into the cell that has the focus; then the key that ends it."""
        self.page.keyboard.type(text)
        self.page.keyboard.press(then)
        self._spent(0, len(text) + 1)

    def _spent(self, clicks: int, keys: int) -> None:
        self.clicks, self.keys = self.clicks + clicks, self.keys + keys
        self.seconds += CLICK * clicks + KEY * keys


def create(person: Person) -> None:
    """New, three bodies."""
    person.click("button.new")
    person.write("3")
    person.page.wait_for_function("() => pgraph.latest.table.rows.length === 3")


def rename(person: Person) -> None:
    """Names, one below the other."""
    person.click('tr[data-name="1"] input.name')
    person.page.keyboard.press("F2")
    person.page.keyboard.press("Control+a")
    person.seconds += 2 * KEY
    for name, below in (("crank", "2"), ("coupler", "3"), ("rocker", "rocker")):
        person.write(name)
        person.page.locator(f'tr[data-name="{name}"]').wait_for()
        person.page.wait_for_function(ROW_OF_FOCUS, arg=below)


def bend(person: Person) -> None:
    """The three joints in degrees, and that pose as the initial state."""
    person.click('[role="tab"][title="Pose"]')
    person.click('.pgraph[data-view="joints"] .joint:nth-child(1) .cell')
    for angle in ("-1", "0.7"):
        person.write(angle, then="Tab")
    person.write("1.3")
    person.page.wait_for_function("() => Math.abs(pgraph.latest.joints.rows[2].value - 1.3) < 1e-9")
    person.click('.pgraph[data-view="joints"] button.use')


def close(person: Person) -> None:
    """A hinge between the rocker, selected, and the ground closes the loop: the cut joint."""
    person.click('[role="tab"][title="Constraints"]')
    person.click("button.add-tie")
    person.click('[data-kind="loops revolute"]')
    person.click('.pgraph-banner button:text-is("ground")')
    person.page.locator('.pgraph[data-view="constraints"] .tie.open').wait_for()


def simulate(person: Person) -> None:
    """A free run, and play."""
    person.click("button.simulate")
    person.page.locator(".summary dd").first.wait_for(timeout=60_000)
    person.click("button.play")


STEPS: tuple[Callable[[Person], None], ...] = (create, rename, bend, close, simulate)


# -- a six-axis arm with a gripper that picks up a box ---------------------------------------------

MODEL = """async ([test, arg]) => {  // until the table holds what it should
  const right = new Function("rows", "arg", `return ${test}`);
  while (!right(pgraph.latest.table.rows, arg)) await new Promise((next) => setTimeout(next, 20));
}"""


def row(name: str) -> str:
    return f'tr[data-name="{name}"] td.number'


def select(person: Person, name: str, *, holding: str = "", count: int = 1) -> None:
    """A row, alone or with others; a person then sees what the properties are of."""
    person.click(row(name), holding=holding)
    person.page.wait_for_function(
        "([name, n]) => ((found) => found.length === n && found.includes(name))"
        "(pgraph.latest.properties.bodies)",
        arg=[name, count],
    )


def cell(field: str, at: int = 0) -> str:
    return f'[data-view=properties] [data-field="{field}"] .cell >> nth={at}'


def part(field: str) -> str:
    return f'.tie.open [data-field="{field}"] .cell'


def rows(person: Person, test: str, arg: Any = None) -> None:
    """Wait until the rows of the table are so."""
    person.page.evaluate(MODEL, [test, arg])


def force(person: Person, kind: str, *on: str) -> None:
    """A part of that kind on the selected body, and on what is clicked."""
    opened = person.page.locator(".tie.open strong")
    before = opened.inner_text() if opened.count() else ""
    person.click("button.add-tie")
    person.click(f'[data-kind="{kind}"]')
    for other in on:
        person.click(other)
    person.page.wait_for_function(
        "(name) => document.querySelector('.tie.open strong')?.textContent !== name", arg=before
    )


def box(person: Person) -> None:
    """A box on the ground in front of the arm, before there is an arm: nothing is selected."""
    person.click("button.new")
    person.write("6")
    rows(person, "rows.length === 6")
    person.click("button.add")
    rows(person, "rows.length === 7")
    person.choose(cell("joint"), "free")
    rows(person, "rows[6].dof === 6")
    person.click(cell("link"))
    person.write("1.2 0 .025")
    if not person.page.locator(cell("shape_kind")).is_visible():  # folded until it was opened once
        person.click('[data-view=properties] details[data-title="Shape"] summary')
    person.choose(cell("shape_kind"), "box")
    person.click(cell("shape_size"))
    person.write(".05 .05 .05")
    person.click('[role="tab"][title="Constraints"]')
    force(person, "contacts complementarity", '.pgraph-banner button:text-is("ground")')


def joints(person: Person) -> None:
    """The first joint upright, the fourth and the sixth along the arm."""
    select(person, "1")
    person.click(cell("link", 2))
    person.write(".025")
    person.click(cell("axes"))
    person.write("z")
    select(person, "4")
    select(person, "6", holding="Control", count=2)
    person.click(cell("axes"))
    person.write("x")


def gripper(person: Person) -> None:
    """Shapes of all bodies, from which mass, centre and inertia follow; a finger that slides, with
    its servo and its contact with the box; then its mirror image."""
    select(person, "6")
    person.press("Control+Enter")
    rows(person, "rows.length === 8")
    person.press("Control+a")
    person.page.wait_for_function("pgraph.latest.properties.bodies.length === 8")
    person.click('[data-view=properties] [data-field="mass"] button:text-is("derive")')
    select(person, "8")
    person.choose(cell("joint"), "prismatic")
    person.click(cell("q"))
    person.write(".05")
    force(person, "forces servo")
    person.click(part("target"))
    person.write("0")
    force(person, "contacts complementarity", row("7"))
    person.click("button.mirror")
    person.click("button.plane-y")
    rows(person, "rows.length === 9")


def drives(person: Person) -> None:
    """Servos for the arm; the second joint lifts it after a second; the run."""
    select(person, "1")
    select(person, "6", holding="Shift", count=6)
    force(person, "forces servo")
    person.click('.tie[data-name="servo 3"] .title')
    person.click(part("target"))
    person.write("1 0; 2 -.5")
    person.click("button.simulate")


ARM_STEPS = (box, joints, gripper, drives)


# -- a URDF with meshes and a loop -----------------------------------------------------------------

LINKS = {  # name: parent, origin in it [m], length [m], direction of the rod
    "crank": ("base", (0.0, 0.0, 0.0), 0.3, (0.6, 0.0, 0.8)),
    "coupler": ("crank", (0.18, 0.0, 0.24), 0.6, (0.96, 0.0, 0.28)),
    "pin": ("coupler", (0.576, 0.0, 0.168), 0.0, (0.0, 0.0, 0.0)),
    "rocker": ("base", (0.7, 0.0, 0.0), 0.412, (0.136, 0.0, 0.99)),
}


def four_bar_archive() -> bytes:
    """A zip of a URDF of the open chains of a four-bar, each rod with a mesh."""
    parts, kept = ['<link name="base"/>'], BytesIO()
    with zipfile.ZipFile(kept, "w") as archive:
        for name, (parent, origin, length, way) in LINKS.items():
            mass, inertia = (length, length**3 / 12) if length else (0.01, 1e-5)
            half = " ".join(str(length / 2 * x) for x in way)
            mesh = f'<geometry><mesh filename="meshes/{name}.stl"/></geometry>'
            shape = f'<visual><origin xyz="{half}"/>{mesh}</visual>' if length else ""
            parts.append(
                f'<link name="{name}"><inertial><origin xyz="{half}"/><mass value="{mass}"/>'
                f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" '
                f'iyz="0"/></inertial>{shape}</link><joint name="{name} joint" '
                f'type="{"continuous" if length else "fixed"}"><parent link="{parent}"/>'
                f'<child link="{name}"/><origin xyz="{" ".join(map(str, origin))}"/>'
                '<axis xyz="0 1 0"/></joint>'
            )
            if length:
                rod: Any = trimesh.creation.box((0.04, 0.04, length))
                turn: Any = trimesh.geometry.align_vectors((0, 0, 1), way)
                archive.writestr(
                    f"meshes/{name}.stl", rod.apply_transform(turn).export(None, "stl")
                )
        archive.writestr("four_bar.urdf", f'<robot name="four_bar">{"".join(parts)}</robot>')
    return kept.getvalue()


def drop(person: Person) -> None:
    """The zip onto the page."""
    person.page.evaluate(
        """(text) => {
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)), data = new DataTransfer();
      data.items.add(new File([bytes], "four_bar.zip"));
      for (const type of ["dragover", "drop"])
        document.body.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true }));
    }""",
        base64.b64encode(four_bar_archive()).decode(),
    )
    person.page.locator('tr[data-name="rocker"]').wait_for()
    person.seconds += DRAG


def tie(person: Person) -> None:
    """The pin of the coupler and the rocker, clicked one after the other, are a joint."""
    person.click('[role="tab"][title="Constraints"]')
    person.click("button.add-tie")
    person.click('[data-kind="loops spherical"]')
    for name in ("pin", "rocker"):
        if person.page.locator(f'.pgraph-banner:has-text("{name}")').count() == 0:
            person.click(f'tr[data-name="{name}"] td.number')
    person.page.locator('.pgraph[data-view="constraints"] .tie.open').wait_for()


def read(person: Person) -> None:
    """What is left of its freedom."""
    done = "() => pgraph.latest.constraints.mobility.state === 'done'"
    person.page.wait_for_function(done, timeout=60_000)
    person.page.locator(".report .headline").wait_for()
    person.seconds += READ


def export(person: Person) -> None:
    """Save as MJCF, which holds the loop."""
    person.click("button.save")
    person.click("button.download-xml")


FILE_STEPS = (drop, tie, read, simulate, export)
