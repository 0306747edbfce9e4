"""Gymnasium's environments: `import pgraph_core.gym`, then `gymnasium.make("pgraph/Quadruped-v0")`.

`gymnasium.make_vec("pgraph/Quadruped-v0", num_envs=1024)` steps many in one `BatchStepper`.
"pgraph/QuadrupedRough-v0" walks over bars of random height, "pgraph/QuadrupedPush-v0" is pushed.
`numbers={"bodies.trunk.mass": (5, 7)}` says which numbers of the description differ from start to
start, and within which bounds. Needs gymnasium: pip install pgraph-dynamics[gym].
"""

from __future__ import annotations

from typing import Any

from .errors import needed

ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "pgraph/Quadruped-v0": {},
    "pgraph/QuadrupedRough-v0": {"terrain": "rough"},
    "pgraph/QuadrupedPush-v0": {"push": True},
}
PLACE = "pgraph_models.quadruped_env"

for _name, _options in ENVIRONMENTS.items():
    needed("gymnasium", "gym").register(
        _name,
        entry_point=f"{PLACE}:QuadrupedEnv",
        vector_entry_point=f"{PLACE}:QuadrupedVectorEnv",
        max_episode_steps=1000,
        kwargs=_options,
    )
