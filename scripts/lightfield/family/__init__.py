"""Builds the members of families: all stages of one member after another, in one process."""
