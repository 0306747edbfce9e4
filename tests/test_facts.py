"""Code asks a method for facts, and names methods only where it chooses one."""

from pgraph_core.integrators import METHODS

from .comparisons import compared, sources

# choices of a method, and programs that have methods of their own
CHOOSE = "pgraph_core/integrators.py", "pgraph_core/simulation/choice.py", "pgraph_peers/"


def test_nobody_asks_which_method_it_is():
    """An entry of METHODS states the facts, so that another method needs no other change."""
    found = [
        f"{name}:{line}: {method}"
        for name, tree in sources() if not name.startswith(CHOOSE)
        for line, method in compared(tree, METHODS)
    ]  # fmt: skip
    assert found == []
