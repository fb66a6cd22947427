"""The arm that executes a motion: kinematics, timing, a simulated scene, films of it."""
