"""Demonstrations: the one data type for recordings, its readers, generators, preprocessing and storage."""
