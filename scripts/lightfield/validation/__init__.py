"""Whether a finished dataset is whole and right."""
