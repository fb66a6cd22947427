"""Riemannian geometry of learned manifolds: pulled-back metrics, curves, latent grids, geodesics."""
