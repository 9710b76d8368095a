"""Builds the members of families: the jobs of one member after another, in one process."""
