"""Integration methods, step loops, dense output and events."""
