"""Robot motion from demonstrations: Riemannian geodesics and contractive vector fields."""

__version__ = "0.1.0"
