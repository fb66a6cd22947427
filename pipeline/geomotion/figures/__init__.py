"""Figures and reports: data in, matplotlib figures and HTML out. Nothing here computes a score."""
