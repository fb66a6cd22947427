"""Fitting fields to demonstrations: objectives and the one training loop."""
