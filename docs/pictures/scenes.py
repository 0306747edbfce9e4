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
    page.evaluate("(name) => pgraph.front(name)", name)


def select(page: Page, name: str) -> None:
    page.evaluate("(body) => pgraph.send('Select', { body })", name)
    page.wait_for_function("(body) => pgraph.latest.properties.bodies.join() === body", arg=name)


def simulate(page: Page, at: float = 0.6) -> None:
    """The run of the scenario, shown at that part of it."""
    page.locator("button.play").click(modifiers=["Shift"])
    page.locator("[data-view=trust] .verdict .link").wait_for(timeout=LONG)
    scrub(page, at)


def scrub(page: Page, at: float) -> None:
    slider = page.locator("input.scrub")
    slider.evaluate("(e, at) => { e.value = at * e.max; e.dispatchEvent(new Event('input')); }", at)


def menu(page: Page, which: str) -> None:
    """A command of the menu of the model: "new", "open" or "save"."""
    page.locator("button.model-menu").click()
    page.locator(f".pgraph-menu:popover-open button.{which}").click()


def overview(page: Page) -> None:
    """The trot, a leg selected, in the middle of a step."""
    simulate(page, 0.162)
    select(page, "right_humerus")


def steps(page: Page) -> None:
    """Halfway through the seven steps."""
    page.get_by_role("button", name="How it is built", exact=True).click()
    for _ in range(9):
        page.locator("button.next").first.click()


def constraints(page: Page) -> None:
    """One of them open, with what is left free."""
    tab(page, "Connections")
    page.locator(".tie .title").first.click()
    page.wait_for_function("() => pgraph.latest.constraints.mobility.state === 'done'")


def kinds(page: Page) -> None:
    """All kinds of constraints, to choose from."""
    tab(page, "Connections")
    page.locator("button.add-tie").click()


def operators(page: Page) -> None:
    tab(page, "Matrices")
    page.wait_for_function("() => pgraph.latest.operator")


def plots(page: Page) -> None:
    simulate(page)
    select(page, "left_tibia")
    tab(page, "Plots")
    for kind, of in (("q", "left_tibia"), ("v", "left_tibia")):
        fields = {"kind": kind, "of": of, "on": True}
        page.evaluate("(fields) => pgraph.send('Plot', fields)", fields)
    page.wait_for_function("() => pgraph.latest.plots.charts.length === 2")


def report(page: Page) -> None:
    tab(page, "Accuracy")
    page.locator("button.precision").click()
    page.locator(".outcome .figure svg").wait_for(timeout=LONG)


def show(page: Page) -> None:
    page.get_by_role("button", name="Display").click()


def walk(page: Page, until: float = 3.2, at: float = 0.9) -> None:
    """A walk that was stopped after a while, shown at a part of it."""
    tab(page, "Scenarios")
    page.locator(".walk-on").click()
    page.wait_for_function("(t) => (pgraph.latest.time ?? [0])[0] > t", arg=until, timeout=LONG)
    page.locator(".walk-on").click()
    page.wait_for_function("() => pgraph.latest.run.summary !== null", timeout=LONG)
    scrub(page, at)


def fall(page: Page) -> None:
    """On ice, where it cannot stand."""
    tab(page, "Scenarios")
    friction = page.locator('[aria-label="friction of the ground"]')
    friction.fill("0.02")
    friction.press("Enter")
    page.locator(".walk-on").click()
    page.wait_for_function("() => pgraph.latest.run.summary !== null", timeout=LONG)


def live(page: Page) -> None:
    """A run that plays while it computes."""
    page.locator(".modes .live").click()
    page.locator("button.play").click()
    page.wait_for_function("() => (pgraph.latest.time ?? [0])[0] > 0.2", timeout=LONG)


def picking(page: Page) -> None:
    """A new constraint that asks for its bodies."""
    kinds(page)
    page.locator('[data-kind="constraints distance"]').click()
    page.locator(".pgraph-banner").wait_for()


def several(page: Page) -> None:
    """Two bodies selected."""
    select(page, "left_femur")
    page.evaluate("pgraph.send('ToggleBody', { body: 'right_femur' })")


def opening(page: Page) -> None:
    menu(page, "open")


def saving(page: Page) -> None:
    menu(page, "save")


def keys(page: Page) -> None:
    page.locator("button.keys").click()


def refused(page: Page) -> None:
    """Two cells that are not taken, and why."""
    page.locator('table.bodies tr[data-name="lumbar"]').hover()
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
    page.evaluate("pgraph.toast('Downloaded quadruped.json', true)")


def many(page: Page) -> None:
    """A chain of a thousand."""
    menu(page, "new")
    page.locator(".asked input").fill("1000")
    page.locator(".asked .go").click()
    page.wait_for_function("() => pgraph.latest.table.rows.length === 1000")
    page.wait_for_timeout(3000)


def nothing(page: Page) -> None:
    pass


SCENES = {
    "page": Scene("quadruped_hips", overview),
    "tab_steps": Scene("quadruped", steps),
    "tab_constraints": Scene("slider_crank", constraints),
    "tab_operators": Scene("quadruped", operators),
    "tab_plots": Scene("quadruped", plots),
    "tab_report": Scene("double_pendulum", report),
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
