"""What the pictures of the page show: the model, and what a person does before each is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from playwright.sync_api import Page

LONG = 120_000  # [ms] compiled code on a busy machine


class Scene(NamedTuple):
    """A picture: the model it is of, and what a person does before it is taken."""

    model: str
    prepare: Callable[[Page], None]


def tab(page: Page, name: str) -> None:
    page.locator(f'[role="tab"][title="{name}"]').click()


def select(page: Page, name: str) -> None:
    page.locator(f'table.bodies tr[data-name="{name}"] td.number').click()


def simulate(page: Page, at: float = 0.6) -> None:
    """The run of the scenario, shown at that part of it."""
    page.get_by_role("button", name="Simulate", exact=True).click()
    page.locator(".summary dd").first.wait_for(timeout=LONG)
    scrub(page, at)


def scrub(page: Page, at: float) -> None:
    slider = page.locator('.pgraph[data-view="playback"] input[type="range"]')
    slider.evaluate("(e, at) => { e.value = at * e.max; e.dispatchEvent(new Event('input')); }", at)


def overview(page: Page) -> None:
    """The quadruped's stance, a leg selected, in the middle of its push."""
    simulate(page)
    select(page, "right_radius")


def steps(page: Page) -> None:
    """Halfway through the seven steps."""
    page.get_by_role("button", name="Step through").click()
    for _ in range(9):
        page.locator("button.next").first.click()


def constraints(page: Page) -> None:
    """One of them open, with what is left free."""
    tab(page, "Constraints")
    page.locator(".tie .title").first.click()
    page.wait_for_function("() => pgraph.latest.constraints.mobility.state === 'done'")


def kinds(page: Page) -> None:
    """All kinds of constraints, to choose from."""
    tab(page, "Constraints")
    page.locator("button.add-tie").click()


def operators(page: Page) -> None:
    tab(page, "Operators")
    page.wait_for_function("() => pgraph.latest.operator")


def plots(page: Page) -> None:
    simulate(page)
    select(page, "left_tibia")
    tab(page, "Plots")
    for kind in ("q", "v", "energy"):
        page.locator(f'.chip-button[data-kind="{kind}"]').first.click()
        page.locator(f'.chip-button[data-kind="{kind}"][aria-pressed="true"]').wait_for()


def report(page: Page) -> None:
    tab(page, "Report")
    page.locator("button.precision").click()
    page.locator(".outcome .figure svg").wait_for(timeout=LONG)


def pose(page: Page) -> None:
    tab(page, "Pose")


def show(page: Page) -> None:
    tab(page, "Show")


def walk(page: Page, until: float = 3.2, at: float = 0.9) -> None:
    """A walk that was stopped after a while, shown at a part of it."""
    tab(page, "Gait")
    page.locator(".walk-on").click()
    page.wait_for_function("(t) => (pgraph.latest.time ?? [0])[0] > t", arg=until, timeout=LONG)
    page.locator(".walk-on").click()
    page.locator(".summary dd").first.wait_for(timeout=LONG)
    scrub(page, at)


def fall(page: Page) -> None:
    """On ice, where it cannot stand."""
    tab(page, "Gait")
    friction = page.locator('[aria-label="friction of the ground"]')
    friction.fill("0.02")
    friction.press("Enter")
    page.locator(".walk-on").click()
    page.locator(".summary dd").first.wait_for(timeout=LONG)


def live(page: Page) -> None:
    """A run that plays while it computes."""
    page.locator("button.live").click()
    page.wait_for_function("() => (pgraph.latest.time ?? [0])[0] > 0.2", timeout=LONG)


def picking(page: Page) -> None:
    """A new constraint that asks for its bodies."""
    kinds(page)
    page.locator('button[data-kind="constraints distance"]').click()
    page.locator(".pgraph-banner").wait_for()


def several(page: Page) -> None:
    """Two bodies selected."""
    select(page, "left_femur")
    page.locator('table.bodies tr[data-name="right_femur"] td.number').click(modifiers=["Control"])


def opening(page: Page) -> None:
    page.locator("button.open").click()


def saving(page: Page) -> None:
    page.locator("button.save").click()


def keys(page: Page) -> None:
    page.locator("button.keys").click()


def refused(page: Page) -> None:
    """Two cells that are not taken, and why."""
    name = page.locator('table.bodies tr[data-name="lumbar"] input.name')
    name.fill("thorax")
    name.press("Enter")
    page.locator("table.bodies tr.sentence").wait_for()
    mass = page.locator('[data-field="mass"] input').first
    mass.fill("-1")
    mass.press("Enter")
    page.locator('[data-field="mass"] + .sentence, .properties .sentence').first.wait_for()


def notice(page: Page) -> None:
    """A notice of what was done, and one of what was not."""
    page.evaluate(
        "pgraph.toast('big.json was not opened: it has 9.1 MB; a model file has at most 8 MB.')"
    )
    dof = page.locator('table.bodies tr[data-name="lumbar"] select').nth(1)
    dof.focus()
    dof.select_option("2")


def many(page: Page) -> None:
    """A chain of a thousand."""
    page.locator("button.new").click()
    page.locator(".asked input").fill("1000")
    page.locator(".asked .go").click()
    page.wait_for_function("() => pgraph.latest.table.rows.length === 1000")
    page.wait_for_timeout(3000)


def nothing(page: Page) -> None:
    pass


SCENES = {
    "page": Scene("quadruped", overview),
    "tab_steps": Scene("quadruped", steps),
    "tab_constraints": Scene("slider_crank", constraints),
    "tab_operators": Scene("quadruped", operators),
    "tab_plots": Scene("quadruped", plots),
    "tab_report": Scene("double_pendulum", report),
    "tab_pose": Scene("quadruped", pose),
    "tab_show": Scene("quadruped_hips", show),
    "tab_gait": Scene("quadruped_hips", walk),
    "fall": Scene("quadruped_hips", fall),
    "live": Scene("pendulum", live),
    "picking": Scene("four_bar", picking),
    "ties": Scene("quadruped_hips", constraints),
    "kinds": Scene("four_bar", kinds),
    "loop": Scene("four_bar", nothing),
    "several": Scene("quadruped", several),
    "opening": Scene("quadruped", opening),
    "saving": Scene("quadruped", saving),
    "keys": Scene("quadruped", keys),
    "refused": Scene("quadruped", refused),
    "notice": Scene("quadruped", notice),
    "many": Scene("quadruped", many),
}
