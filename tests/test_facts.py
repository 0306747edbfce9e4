"""Code asks a method or a kind of motion for facts, and names it only where it chooses one."""

from pgraph_core.integrators import METHODS
from pgraph_core.joints import KINDS

from .comparisons import compared, sources

# choices of a method, and programs that have methods of their own
CHOOSE = "pgraph_core/integrators.py", "pgraph_core/simulation/choice.py", "pgraph_peers/"
# the word is not a kind of motion there: tags of files, a base of URDF, the form of a field; peers
# translate models for other programs
WORDS = (
    "pgraph_core/mesh_files.py", "pgraph_core/formats/urdf.py", "pgraph_app/constraints/parts.py",
    "pgraph_app/constraints/view.py",
    "pgraph_peers/",
)  # fmt: skip


def test_nobody_asks_which_method_it_is():
    """An entry of METHODS states the facts, so that another method needs no other change."""
    found = [
        f"{name}:{line}: {method}"
        for name, tree in sources(METHODS) if not name.startswith(CHOOSE)
        for line, method in compared(tree, METHODS)
    ]  # fmt: skip
    assert found == []


def test_nobody_asks_which_motion_it_is():
    """An entry of KINDS in `joints` states the facts: turns, travels, directed, single, ..."""
    found = [
        f"{name}:{line}: {kind}"
        for name, tree in sources(KINDS) if not name.startswith(WORDS)
        for line, kind in compared(tree, KINDS)
    ]  # fmt: skip
    assert found == []
