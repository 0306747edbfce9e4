"""What a person does on the page, by clicks and keys: docs/tutorial.md, and a URDF with a loop.

From New to a simulated four-bar; and from a zip of a URDF with its meshes, through the loop that
URDF cannot hold, to the run and back to a file.

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

    def think(self) -> None:
        self.seconds += THOUGHT

    def click(self, what: str) -> None:
        self.page.locator(what).first.click()
        self.seconds += CLICK

    def write(self, text: str, *, then: str = "Enter") -> None:
        """Into the cell that has the focus; then the key that ends it."""
        self.page.keyboard.type(text)
        self.page.keyboard.press(then)
        self.seconds += KEY * (len(text) + 1)


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
        person.page.keyboard.press("Tab")  # over the next name
        person.page.keyboard.press("Tab")  # and its slider
        person.seconds += 2 * KEY
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
