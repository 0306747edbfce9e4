"""What a scene is, as kernels take it.

A *scene* is what never changes during a run, and the workspaces, in one tuple behind one address
(`handle`), so that every method takes the same, and a sweep one argument instead of all arrays.
"""

from numba import types

from .compiler.address import stored

F1 = types.float64[::1]
F2 = types.float64[:, ::1]
F3 = types.float64[:, :, ::1]
I1 = types.int64[::1]
I2 = types.int64[:, ::1]
DRIVES = types.Tuple((F2, F2, types.int64))
LOADS = types.Tuple((I2, F2, F2))
BLOCKS = types.Tuple((I2, F2, I2, F1, F2, I1))
SPACE = types.Tuple((F2, I2, F2, F2, F2, F2, F2, F2, F2, F2, I1, F2, I1))
# a user's function: its address (0: none), q, v and τ as rows, and what it answered
USER = types.Tuple((types.int64, F2, I1))
# rows, const, drives, loads, blocks, work, space, gains of Baumgarte, given torques, user
SCENE = types.Tuple((I2, F2, DRIVES, LOADS, BLOCKS, F2, SPACE, F1, F1, USER))
# q, v, v', wrenches of blocks, energies and ledger, residuals, wrenches of contacts on bodies,
# touches: one row a frame
OUT = types.Tuple((F2, F2, F2, F3, F2, F2, F3, F3))

save, opened = stored(SCENE)
