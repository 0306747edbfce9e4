"""Interface to numba's internals: disk cache, addresses of scenes and kernels, SIMD types."""
