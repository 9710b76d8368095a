"""Synthesises views from anywhere in a light field, from its nearest views and their depth."""
