"""Checks that a finished dataset is complete and correct."""
