"""The Plenoforge library: lenses, rigs, depth, resampling, images and records of light fields."""

from lightfield.core.isolation import isolate

# Before a program imports what a variable could change.
isolate()
