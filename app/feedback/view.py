"""The dialog for state feedback: specification, gains, poles and a response."""

from __future__ import annotations

import numpy as np

import pgraph_core as pg

from ..core.cells import Display, cell, choice, field, group, quantity_in, shown
from ..core.views import NOTHING, Payload, Place, topic
from ..signals import spoken
from . import SETTLED, Client, Design, Response, State, coordinates, named, response, unit_of

METHODS = (("lqr", "LQR"), ("poles", "pole placement"))


def feedback(design: Design, display: Display) -> Payload:
    """Return the form and the result."""
    found, payload = design.found, {"busy": design.busy, "problem": design.problem}
    payload["groups"] = [group("", _asked(design)), *_allowed(design, display)]
    if found is None or design.problem:
        return payload | {"gains": None, "poles": [], "curves": [], "hold": "", "stable": False}
    rows = [
        {"name": name, "gains": [float(x) for x in row]} for name, row in zip(found.inputs, found.K)
    ]
    return payload | {
        "gains": {"states": found.states, "rows": rows},
        "poles": poles(found.poles),
        "stable": found.stable,
        "hold": " ".join((_held(design, display), *found.notices)),
        "curves": [(called(name, found), t, y) for name, t, y in response(design)],
    }


def called(name: str, found: pg.Feedback) -> str:
    """Return a readable name of an input or a state."""
    return name if name in found.inputs else spoken(name)


def stepped(response: Response, display: Display) -> Payload:
    """Return the curves of a response to a step, and their description."""
    of = quantity_in(response.unit)
    size = f"{shown(response.size, of, display):.4g} {display.unit(of) or response.unit}".strip()
    settled = "Not settled at the end"
    if response.settled is not None:
        settled = f"Within {SETTLED:.0%} of the final value after {response.settled:.3g} s"
    texts = (
        f"Overshoot {response.overshoot:.1%}", f"Error at the end {response.left:.2%}",
        settled,
    )  # fmt: skip
    return vars(response) | {"size": size, "texts": texts}


def poles(values: np.ndarray) -> list[str]:
    """Return poles as text, complex ones in pairs."""
    found = []
    for x in values:
        if abs(x.imag) <= 1e-12 * abs(x):
            found.append(f"{x.real:.4g}")
        elif x.imag > 0:
            found.append(f"{x.real:.4g} ± {x.imag:.4g}i")
    return found


def _asked(design: Design) -> list[Payload]:
    asked = design.asked
    rows = [choice("method", "Method", asked.method, METHODS)]
    if asked.method == "poles":
        text = ", ".join(_typed(x) for x in asked.poles or ())
        rows.append(field("poles", "Poles", [cell((), text)], unit="1/s", kind="text",
                          help="eigenvalues of the closed loop: -2, -3+1i, -3-1i"))  # fmt: skip
    known = coordinates(design)
    names = [body.name for body in design.model.bodies if body.dof == 1]
    if 0 < len(known) < sum(body.dof for body in design.model.bodies):
        row = [cell((k,), name) for k, name in enumerate(known)]
        rows.append(field("states", "Coordinates", row, kind="choice", columns=1,
                          options=sorted({*names, *known}, key=[*names, *known].index),
                          help="coordinates that determine all others"))  # fmt: skip
    if design.found is not None:
        states = design.found.positions
        step = asked.step if asked.step in states else states[0]
        options = [(x, called(x, design.found)) for x in states]
        rows.append(choice("step", "Step of", step, options, help="in the response"))
    return rows


def _typed(x: complex) -> str:
    return f"{x.real:.6g}" if not x.imag else f"{x.real:.6g}{x.imag:+.6g}i"


def _allowed(design: Design, display: Display) -> list[Payload]:
    """Find the largest inputs and deviations, which determine the weights."""
    names, asked = named(design), design.asked
    count = len(names) - (len(design.found.states) if design.found else 0)
    rows = []
    for k, name in enumerate(names):
        unit = unit_of(design.model, name)
        of = quantity_in(unit)
        value = asked.largest.get(name, design.largest.get(name))
        one = cell((k,), None if value is None else shown(value, of, display))
        label = name if k < count or design.found is None else called(name, design.found)
        rows.append(field("largest", label, [one], unit=display.unit(of) or unit,
                          help="maximum allowed value; ignored if empty"))  # fmt: skip
    found = [group("Largest input", rows[:count])]
    if asked.method == "lqr" and rows[count:]:
        found.append(group("Largest deviation", rows[count:]))
    return found


def _held(design: Design, display: Display) -> str:
    """Return the state stabilised by the feedback and the corresponding inputs."""
    assert design.found is not None
    found = design.found
    states = list(zip(found.positions, found.at))
    texts = []
    for name, value in (*states, *zip(found.inputs, found.hold)):
        unit = unit_of(design.model, name)
        of = quantity_in(unit)
        amount = f"{shown(float(value), of, display):.4g} {display.unit(of) or unit}"
        texts.append(f"{called(name, found)} = {amount}".strip())
    return ", ".join(texts)


def _answer(state: State, page: Client) -> Payload:
    return NOTHING if page.response is None else stepped(page.response, page.display)


VIEWS = (
    Place(
        topic("feedback", lambda _, page: page.design and feedback(page.design, page.display),
              page=lambda _, page: (page.design, page.display)), 70,
    ),
    Place(topic("response", _answer, page=lambda _, page: (page.response,)), 70),
)  # fmt: skip
