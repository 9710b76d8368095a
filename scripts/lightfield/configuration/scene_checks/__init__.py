"""Whether the blocks of a scene YAML go together: a file for each block."""
