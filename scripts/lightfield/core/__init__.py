"""Errors, failures, files, progress and command lines: what every other room stands on."""
