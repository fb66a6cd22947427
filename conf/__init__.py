"""Hydra configuration files (shipped as ``geomotion.conf``; holds no code)."""
