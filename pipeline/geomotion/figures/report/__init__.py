"""The report of a run: one HTML page that needs nothing else, for people who were not there."""
