"""Motion planning on a learned manifold: from start and goal to a path of poses, or to the reason why there is none."""
