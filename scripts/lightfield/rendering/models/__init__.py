"""Model files, without Blender: what they name and hold, and what Blender misreads in them."""
