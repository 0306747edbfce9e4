"""Pinocchio on a long chain, which may not fit into memory, in a process with a limit."""

from __future__ import annotations

import subprocess
import sys

from .machine import ROOT, has

GIB = 4
SCRIPT = """
import resource, time
resource.setrlimit(resource.RLIMIT_AS, ({limit} << 30, {limit} << 30))
import numpy as np
import pinocchio as pin
model, place = pin.Model(), pin.SE3(1)
place.translation[0] = 1.0
for i in range({n}):
    joint = model.addJoint(i, pin.JointModelRZ(), place, str(i))
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
data, q = model.createData(), np.zeros({n})
pin.aba(model, data, q, q, q)
begin = time.perf_counter()
pin.aba(model, data, q, q, q)
print(time.perf_counter() - begin)
"""


def pinocchio_chain(n: int) -> str:
    """One sentence: the time of pin.aba on a chain of n, or why it failed."""
    if not has("pin"):
        return f"pin.aba on a chain of {n}: pin is not installed"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(limit=GIB, n=n)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    if done.returncode:
        memory = "MemoryError" in done.stderr or "bad_alloc" in done.stderr
        why = f"its data does not fit into {GIB} GiB of memory" if memory else "it failed"
        return f"pin.aba on a chain of {n}: {why}"
    return f"pin.aba on a chain of {n}: {float(done.stdout) * 1e6:.3g} us, within {GIB} GiB"
