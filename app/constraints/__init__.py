"""Constraints, contacts, forces, loops and joint limits: their tab."""
