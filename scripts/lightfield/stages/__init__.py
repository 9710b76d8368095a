"""The stages of a build: their inputs, outputs and settings. The rooms below do the work."""
