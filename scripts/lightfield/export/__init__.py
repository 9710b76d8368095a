"""The files with which each trainer opens a dataset."""
