"""Measures the error and the cost of renders, and finds settings that reach a target error."""
