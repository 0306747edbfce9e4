"""Numba types and functions for kernels, imported only where a kernel is compiled."""
