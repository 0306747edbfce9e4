"""The numbers of actuators of MJCF: those of their joint or tendon, and those that are lost."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from ..errors import needed, shown
from .mjcf_compiled import BALL, Compiled

ON_JOINT, ON_TENDON = (0, 1), 3  # mjtTrn: (joint, joint in parent), tendon
# tables of actuators that are read wherever they count, or have no effect by themselves
READ = frozenset((
    "trntype", "trnid", "gear", "dyntype", "dynprm", "gaintype", "gainprm", "biastype", "biasprm",
    "ctrllimited", "ctrlrange", "actlimited", "actrange", "forcelimited", "forcerange",
    "actearly", "group", "user", "cranklength", "history", "acc0", "length0", "lengthrange",
    *(f"{word}{what}" for word in ("ctrl", "out", "act") for what in ("num", "adr")),
    "historyadr", "ctrlspec",
))  # fmt: skip


def channel(m: Compiled, a: int) -> tuple[int, int]:
    """Return the rows for the output and input of an actuator in MuJoCo's tables."""
    if not hasattr(m, "actuator_outadr"):  # before MuJoCo 4 each actuator has one of both
        return a, a
    return int(m.actuator_outadr[a]), int(m.actuator_ctrladr[a])


def pass_on(m: Compiled) -> list[str]:
    """Add the damping and armature of actuators to their joints or tendons, as MuJoCo does.

    Returns what was added.
    """
    passed = list[str]()
    for word in ("damping", "armature"):
        for a in sorted(m.set_in(f"actuator_{word}")):
            target, gear = int(m.actuator_trnid[a, 0]), float(m.actuator_gear[channel(m, a)[0], 0])
            if m.actuator_trntype[a] == ON_TENDON:
                table, row = getattr(m, f"tendon_{word}"), target
            elif m.actuator_trntype[a] in ON_JOINT and m.jnt_type[target] > BALL:
                table, row = getattr(m, f"dof_{word}"), int(m.jnt_dofadr[target])
            else:
                continue
            own = getattr(m, f"actuator_{word}")
            table[row] += gear**2 * own[a]
            own[a] = 0.0
            passed.append(f"{word} of {shown(m.actuator(a).name or f'actuator {a + 1}')}")
    return passed


def left(m: Compiled, a: int) -> Iterator[str]:
    """Yield texts about the numbers of an actuator that its force lacks.

    These are also numbers in tables that a later MuJoCo adds.
    """
    plain = _plain()
    for table in dir(m.model):
        word = table.removeprefix("actuator_")
        if word == table or word in READ:
            continue
        rows, usual = getattr(m, table), np.ravel(getattr(plain, table)[0])
        by_length = {m.nu: channel(m, a)[1], len(m.actuator_trnid): a}
        own = np.ravel(rows[by_length.get(len(rows), channel(m, a)[0])])
        if not np.array_equal(own, usual):
            yield f"its {word} {' '.join(f'{x:g}' for x in own)}, for which it has no number here"
    if m.actuator_actearly[a] and m.actuator_dyntype[a]:
        yield "actearly: its force follows the activation without the step that MuJoCo adds"


@lru_cache(maxsize=1)
def _plain() -> Any:
    """Return MuJoCo's model of an actuator without numbers of its own."""
    body = '<body><joint name="j"/><geom size="1"/></body>'
    text = f'<worldbody>{body}</worldbody><actuator><general joint="j"/></actuator>'
    return needed("mujoco", "mjcf").MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
