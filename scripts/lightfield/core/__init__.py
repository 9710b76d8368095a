"""Errors, failures, files, progress and command lines, which all other packages use."""
