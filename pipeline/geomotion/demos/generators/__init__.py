"""Generators: demonstrations made by formula, labelled as such."""
