"""Finds out what a .blend holds, needs and lights, and how near its cameras are to geometry."""
