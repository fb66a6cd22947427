"""A trained skill as one function of what a robot measures, ready to be written to a file."""
