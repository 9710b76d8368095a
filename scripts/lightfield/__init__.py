"""The Plenoforge library: lenses, rigs, depth, resampling, images and records of light fields."""
