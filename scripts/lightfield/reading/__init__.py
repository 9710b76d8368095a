"""Opens finished datasets: folders, packages and shards. Needs neither Blender nor numba."""
