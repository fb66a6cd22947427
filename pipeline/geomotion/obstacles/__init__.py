"""Obstacles in state space, and fields that flow around them."""
