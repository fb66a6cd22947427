"""Numbers that judge a result. The word *metric* is kept for Riemannian metrics."""
