"""Collision detection, contact rows, impulses and the phases of contact points."""
