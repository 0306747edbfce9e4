"""Types and functions of kernels for numba, imported only where a kernel is compiled."""
