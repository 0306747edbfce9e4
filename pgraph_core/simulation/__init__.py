"""Runs: options become a plan, the plan is stepped, and frames are recorded.

The package is not called `simulate`, which would hide the function `pgraph_core.simulate`.
"""

from .simulation import simulate as simulate
