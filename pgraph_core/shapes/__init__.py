"""Shapes that touch: convex solids, and meshes with their mass properties."""
