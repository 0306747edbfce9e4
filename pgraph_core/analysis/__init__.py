"""Analysis of a mechanism: assembly, mobility, singular positions, derivatives, vibrations.

Everything here works on `Dynamics`; the public `Mechanism` offers it as methods.
"""
