"""Numba's internals: the disk cache, addresses of scenes and kernels, SIMD types."""
