"""A fishing rod, a robot link and a leaf spring, made at the page in at most 30 clicks each."""

from typing import Any

import pytest

import pgraph_core as pg

from .conftest import opened, until
from .on_page import choose_body, chosen, field, row, typed

MOST = 30
BOX = pg.Shape(kind="box", size=[0.1] * 3)
HAND = pg.Model(name="hand", bodies=[pg.Body(name="hand", joint="weld", shape=BOX)])


class Person:
    """Someone at the page, whose clicks are counted: of buttons, into cells, and two per choice."""

    def __init__(self, page: Any, served: Any):
        self.page, self.served, self.clicks = page, served, 0

    def press(self, place: str) -> None:
        self.clicks += 1
        self.page.locator(place).first.click()

    def select(self, name: str) -> None:
        self.clicks += 1
        choose_body(self.page, name)

    def grow(self, button: str) -> str:
        """Press a button that adds a row, which is selected then, and return its name."""
        before = set(self.served.store.state.ids)
        self.press(f"button.{button}")
        until(lambda: set(self.served.store.state.ids) - before, "another row")
        (name,) = set(self.served.store.state.ids) - before
        self.page.wait_for_function("(n) => pgraph.latest.properties.bodies.join() === n", arg=name)
        return name

    def type(self, name: str, text: str, k: int = 0) -> None:
        self.clicks += 1
        before = self.served.store.state.model
        field(self.page, name, k + len(text.split()) - 1).wait_for()
        typed(field(self.page, name, k), text)
        until(lambda: self.served.store.state.model is not before, f"the edit of {name}")

    def choose(self, name: str, value: str) -> None:
        self.clicks += 2
        before = self.served.store.state.model
        chosen(field(self.page, name), value)
        until(lambda: self.served.store.state.model is not before, f"the choice of {name}")

    def heavy(self, mass: str) -> str:
        """Add a ball to the selected row."""
        ball = self.grow("add")
        self.choose("joint", "weld")
        self.type("mass", mass)
        return ball


def fishing_rod(person: Person) -> None:
    person.select("hand")
    rod = person.grow("add-beam")
    person.choose("section_kind", "tube")
    person.type("sizes", "0.006 0.005")
    person.choose("material", "glass")
    person.type("end", "1.7 0 1.7")
    person.type("damping_ratio", "0.03")
    fish = person.heavy("0.5")
    model = person.served.store.state.model
    assert model.part(rod, "beam").parent == "hand"
    assert model.part(rod, "beam").extent == pytest.approx(1.7 * 2**0.5)
    assert model.body(fish).parent == rod


def robot_link(person: Person) -> None:
    person.select("hand")
    joint = person.grow("add")
    person.type("mass", "0.5")
    link = person.grow("add-beam")
    person.choose("section_kind", "rectangle")
    person.type("sizes", "0.04 0.004")
    person.choose("material", "aluminium")
    person.type("length", "0.8")
    tool = person.heavy("0.3")
    model = person.served.store.state.model
    assert (model.body(tool).parent, model.part(link, "beam").parent) == (link, joint)


def leaf_spring(person: Person) -> None:
    person.page.evaluate("pgraph.send('Select', { body: null })")
    leaf = person.grow("add-beam")
    person.choose("section_kind", "rectangle")
    person.type("sizes", "0.06 0.006")
    axle = person.heavy("20")
    person.type("place", "0.5")
    person.select(leaf)
    person.page.evaluate("pgraph.front('Connections')")
    person.clicks += 1
    person.press("button.add-tie")
    person.press('[data-kind="constraints line"]')
    person.clicks += 1
    person.page.get_by_role("button", name="ground", exact=True).click()
    until(lambda: person.served.store.state.model.constraints, "the slide at its end")
    state = person.served.store.state
    assert state.model.constraints[0].pair == (leaf, "ground")
    assert state.model.body(axle).parent == f"{leaf}@0.5"


@pytest.mark.parametrize("make", [fishing_rod, robot_link, leaf_spring], ids=lambda f: f.__name__)
def test_it_is_made_in_few_clicks_and_is_one_row(make, page, served):
    opened(page, served, HAND)
    person = Person(page, served)
    make(person)
    assert person.clicks <= MOST
    (beam,) = served.store.state.model.beams
    assert row(page, beam.name).count() == 1
