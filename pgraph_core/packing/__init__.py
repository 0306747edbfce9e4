"""Packing: a model as the arrays that the kernels take. `Packed` holds them all."""
