"""A readable report about degrees of freedom and redundant constraint rows."""

from __future__ import annotations

import pgraph_core as pg
from pgraph_core.analysis.mobility import Remark
from pgraph_core.errors import counted

from ..core.views import Payload
from . import BY_ITSELF, MobilityReport, State, cables


def mobility_report(state: State) -> Payload:
    """Return a headline, lines that each name a part, and whether the report is current."""
    found = _of_constraints(state)
    return {**found, "lines": [*found["lines"], *_of_cables(state.model)]}


def _of_cables(model: pg.Model) -> list[Payload]:
    """Return a line for each cable among the forces that cannot lie on its wheels."""
    if not any(isinstance(f, pg.Cable) for f in model.forces):
        return []
    amiss = cables.faults(model)
    led = [f.name for f in model.forces if isinstance(f, pg.Cable) and f.name in amiss]
    return [{**Remark(name, amiss[name], True)._asdict(), "part": "forces"} for name in led]


def _of_constraints(state: State) -> Payload:
    active = [c for c in state.model.constraints if c.active]
    if not active:
        text = f"{counted(state.derived.dof, 'degree')} of freedom, none taken by constraints."
        return {"state": "done", "text": text, "lines": []}
    report = MobilityReport.known(state)
    if report is None:
        if state.derived.dof > BY_ITSELF and state.mobility_asked is not state.model:
            text = f"{counted(state.derived.dof, 'degree')} of freedom of the tree."
            return {"state": "large", "text": text, "lines": []}
        return {"state": "waiting", "text": "Counting degrees of freedom ...", "lines": []}
    if report.found is None:
        blamed = [Remark(c.name, "", True) for c in active if f"'{c.name}'" in report.problem]
        text = f"{report.problem[:1].upper()}{report.problem[1:].rstrip('.')}."
        return {"state": "failed", "text": text, "lines": [line._asdict() for line in blamed]}
    lines = [line._asdict() for line in report.found.remarks]
    return {"state": "done", "text": report.found.headline, "lines": lines}
