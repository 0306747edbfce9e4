"""Poses by hand: joint sliders, the gizmo in 3D, pulling on a body."""
