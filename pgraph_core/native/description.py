"""The modelDescription.xml of an FMU."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from ..simulation.plan import VERSION
from ..tolerances import SOLVED
from .image import DERIVATIVE, INPUT, OUTPUT, PARAMETER, STATE, TIME, Exported, Variable

Element = Xml.Element
CO_SIMULATION, MODEL_EXCHANGE = "cs", "me"
# {unit: exponents of base units}
BASE = {name: {name: 1} for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
UNITS: dict[str, dict[str, int]] = {
    **BASE, "1": {}, "N": {"kg": 1, "m": 1, "s": -2}, "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3}, "Pa": {"kg": 1, "m": -1, "s": -2},
}  # fmt: skip
CAUSALITY = {TIME: "independent", INPUT: "input", PARAMETER: "parameter", STATE: "local",
             OUTPUT: "output", DERIVATIVE: "local"}  # fmt: skip


class Fmu(NamedTuple):
    """The facts of an FMU that its description states."""

    exported: Exported
    identifier: str  # name of the binaries
    token: str
    kinds: Sequence[str]  # CO_SIMULATION, MODEL_EXCHANGE

    @property
    def variables(self) -> Sequence[Variable]:
        """All variables in the order of their value references."""
        return self.exported.variables

    def numbers(self, *kinds: int) -> list[int]:
        """Return the value references of variables of these kinds."""
        return [k for k, one in enumerate(self.variables) if one.kind in kinds]

    @property
    def knowns(self) -> list[int]:
        """The inputs and states of model exchange on which outputs and derivatives depend."""
        return self.numbers(STATE, INPUT) if MODEL_EXCHANGE in self.kinds else self.numbers(INPUT)

    @property
    def outputs(self) -> list[int]:
        """The outputs. Those of a model without any are its coordinates and velocities."""
        return self.numbers(OUTPUT) or self.numbers(STATE)

    def dependencies(self, k: int) -> list[int]:
        """Return the variables on which an output or a derivative depends."""
        one = self.variables[k]
        if one.kind == STATE:
            return [k] if MODEL_EXCHANGE in self.kinds else []
        return [x for x in self.knowns if one.immediate or self.variables[x].kind == STATE]

    @property
    def unknowns(self) -> list[int]:
        """The variables that the initialization computes."""
        own = [STATE] if self.assembled else []
        return self.numbers(OUTPUT, DERIVATIVE, *own)

    @property
    def assembled(self) -> bool:
        """Return True if constraints change the states at the start."""
        return bool(self.exported.run.header()["project"])


def exponents(unit: str) -> Mapping[str, int] | None:
    """Return the exponents of the base units of a unit, or None if they are not known."""
    found: dict[str, int] = {}
    above, _, below = unit.replace("²", "^2").replace("·", " ").partition("/")
    for words, sign in ((above, 1), (below, -1)):
        for word in words.split():
            known = re.fullmatch(r"([A-Za-z]+|1)(?:\^(-?\d+))?", word)
            if known is None or known[1] not in UNITS:
                return None
            for name, n in UNITS[known[1]].items():
                found[name] = found.get(name, 0) + sign * n * int(known[2] or 1)
    return {name: n for name, n in found.items() if n}


def _units(root: Element, tag: str, variables: Iterable[Variable]) -> None:
    units = sorted({one.unit for one in variables if one.unit})
    group = Xml.SubElement(root, "UnitDefinitions") if units else root
    for unit in units:
        one, known = Xml.SubElement(group, tag, name=unit), exponents(unit)
        if known is not None:
            Xml.SubElement(one, "BaseUnit", {name: str(n) for name, n in known.items()})


def _root(fmu: Fmu, version: str, **more: str) -> Element:
    model = fmu.exported.model
    return Xml.Element("fmiModelDescription", {
        "fmiVersion": version, "modelName": model.name or fmu.identifier, **more,
        "description": "A mechanism, exported by Pgraph", "version": VERSION,
        "generationTool": f"Pgraph {VERSION}", "variableNamingConvention": "flat",
    })  # fmt: skip


def _categories(root: Element) -> None:
    group = Xml.SubElement(root, "LogCategories")
    for name in ("logStatusError", "logStatusDiscard"):
        Xml.SubElement(group, "Category", name=name)


def _experiment(root: Element, fmu: Fmu, more: Mapping[str, str]) -> None:
    start = fmu.variables[0].value
    span = {"startTime": repr(start), "stopTime": repr(start + fmu.exported.span)}
    tolerance = fmu.exported.wanted.rtol or SOLVED
    Xml.SubElement(root, "DefaultExperiment", {**span, "tolerance": repr(tolerance), **more})


def _facts(fmu: Fmu, k: int) -> dict[str, str]:
    """Return the attributes of a variable that both versions share."""
    one = fmu.variables[k]
    causality = CAUSALITY[OUTPUT if k in fmu.outputs else one.kind]
    found = {"causality": causality, "variability": "continuous"}
    if one.about:
        found["description"] = one.about
    if one.kind == PARAMETER:
        found["variability"] = "fixed"
    if one.kind == STATE:
        found["initial"] = "approx" if fmu.assembled else "exact"
    if one.kind in (OUTPUT, DERIVATIVE):
        found["initial"] = "calculated"
    return found


def _numbers(one: Variable) -> dict[str, str]:
    """Return the attributes of its value."""
    found = {"unit": one.unit} if one.unit else {}
    for name, x in (("min", one.low), ("max", one.high)):
        if abs(x) < float("inf"):
            found[name] = repr(float(x))
    if one.kind in (INPUT, PARAMETER, STATE):
        found["start"] = repr(float(one.value))
    return found


def written(root: Element) -> bytes:
    """Return the file."""
    Xml.indent(root)
    return Xml.tostring(root, encoding="UTF-8", xml_declaration=True)


# -- FMI 3.0 ---------------------------------------------------------------------------------------


def fmi3(fmu: Fmu) -> bytes:
    """Return the description by FMI 3.0."""
    root = _root(fmu, "3.0", instantiationToken=fmu.token)
    can = {"modelIdentifier": fmu.identifier, "canGetAndSetFMUState": "true",
           "canSerializeFMUState": "true",
           "providesDirectionalDerivatives": "true"}  # fmt: skip
    step = {} if fmu.exported.by_tolerance else {"stepSize": repr(fmu.exported.setup.step)}
    if MODEL_EXCHANGE in fmu.kinds:
        needs = {"needsCompletedIntegratorStep": "true"}
        Xml.SubElement(root, "ModelExchange", {**can, **needs})
    if CO_SIMULATION in fmu.kinds:
        own = {"canHandleVariableCommunicationStepSize": "true"}
        if step:
            own["fixedInternalStepSize"] = step["stepSize"]
        Xml.SubElement(root, "CoSimulation", {**can, **own})
    _units(root, "Unit", fmu.variables)
    _categories(root)
    _experiment(root, fmu, step)
    group = Xml.SubElement(root, "ModelVariables")
    states = fmu.numbers(STATE)
    for k, one in enumerate(fmu.variables):
        more = {"derivative": str(states[one.read])} if one.kind == DERIVATIVE else {}
        Xml.SubElement(group, "Float64", {
            "name": one.name, "valueReference": str(k), **_facts(fmu, k), **_numbers(one), **more,
        })  # fmt: skip
    structure = Xml.SubElement(root, "ModelStructure")
    for tag, numbers in (("Output", fmu.outputs),
                         ("ContinuousStateDerivative", fmu.numbers(DERIVATIVE))):  # fmt: skip
        for k in numbers:
            on = " ".join(map(str, fmu.dependencies(k)))
            Xml.SubElement(structure, tag, valueReference=str(k), dependencies=on)
    for k in fmu.unknowns:
        Xml.SubElement(structure, "InitialUnknown", valueReference=str(k))
    return written(root)


# -- FMI 2.0 ---------------------------------------------------------------------------------------


def fmi2(fmu: Fmu) -> bytes:
    """Return the description by FMI 2.0."""
    root = _root(fmu, "2.0", guid=fmu.token, numberOfEventIndicators="0")
    can = {"modelIdentifier": fmu.identifier, "canGetAndSetFMUstate": "true",
           "canSerializeFMUstate": "true", "providesDirectionalDerivative": "true"}  # fmt: skip
    if MODEL_EXCHANGE in fmu.kinds:
        Xml.SubElement(root, "ModelExchange", can)
    if CO_SIMULATION in fmu.kinds:
        own = {"canHandleVariableCommunicationStepSize": "true"}
        Xml.SubElement(root, "CoSimulation", {**can, **own})
    _units(root, "Unit", fmu.variables)
    _categories(root)
    step = {} if fmu.exported.by_tolerance else {"stepSize": repr(fmu.exported.setup.step)}
    _experiment(root, fmu, step)
    group = Xml.SubElement(root, "ModelVariables")
    states = fmu.numbers(STATE)
    for k, one in enumerate(fmu.variables):
        scalar = Xml.SubElement(group, "ScalarVariable", {
            "name": one.name, "valueReference": str(k), **_facts(fmu, k),
        })  # fmt: skip
        more = {"derivative": str(states[one.read] + 1)} if one.kind == DERIVATIVE else {}
        Xml.SubElement(scalar, "Real", {**_numbers(one), **more})
    structure = Xml.SubElement(root, "ModelStructure")
    for tag, numbers in (("Outputs", fmu.outputs), ("Derivatives", fmu.numbers(DERIVATIVE)),
                         ("InitialUnknowns", fmu.unknowns)):  # fmt: skip
        inside = Xml.SubElement(structure, tag) if numbers else structure
        for k in numbers:
            unknown: dict[str, Any] = {"index": str(k + 1)}
            if tag != "InitialUnknowns":
                unknown["dependencies"] = " ".join(str(x + 1) for x in fmu.dependencies(k))
            Xml.SubElement(inside, "Unknown", unknown)
    return written(root)
