"""What numba has to know of kernels: imported where one is compiled, and nowhere else."""
