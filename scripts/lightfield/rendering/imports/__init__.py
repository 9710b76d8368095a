"""Makes a scene of a model file with Blender's importers, and mends what these misread."""
