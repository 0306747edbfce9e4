"""Mechanism analysis: assembly, mobility, singular positions, derivatives and vibrations.

Everything here works on `Dynamics`; the public `Mechanism` offers it as methods.
"""
