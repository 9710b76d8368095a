"""The parts of scenes: shapes from numpy, shader graphs, plants, masonry, lights.

Units are metres and radians. Only arguments called `degrees` or `turned` are in degrees. Z is up,
the ground is z = 0. Everything is deterministic: an element draws its random numbers from
`Scene.random`.
"""

import bpy  # noqa: F401  (makes mathutils and bmesh importable)
