"""Pictures that show all variants of a study side by side."""
