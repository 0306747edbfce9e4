"""Tables that a lane reads by an index of its own in each place, defined by `lowering.tables`."""

from typing import Any

from .jit import late

# table[i, column] for an index i that is a whole float, or a lane of them
entry: Any = late("tables", "entry", lambda table, i, column: table[int(i), column])
