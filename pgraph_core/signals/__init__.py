"""Expressions over measurable quantities of a motion: '=-20*q.pole - 3*v.pole + 2*sin(3*t)'.

One grammar for constant formulas of parameters and for expressions that vary in a motion.
`grammar` reads the text, `meaning` says what its names, units and numbers are. Packing turns an
expression into a program, which a kernel evaluates.
"""

from .grammar import Node as Node
from .grammar import Unreadable as Unreadable
from .grammar import filled as filled
from .grammar import is_expression as is_expression
from .grammar import parsed as parsed
from .grammar import parsed_of_columns as parsed_of_columns
from .grammar import signals_in as signals_in
from .grammar import with_names as with_names
from .grammar import written as written
