"""Rotations as vectors: SO(3), S³, and coordinates without an edge."""
