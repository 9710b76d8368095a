"""What the scenes are made of: shapes from numpy, shader graphs, plants, masonry, lights.

Units are metres and radians (degrees only where an argument is called `degrees`), Z is up, the
ground is z = 0. Everything is deterministic: an element draws its random numbers from
`Scene.random`. Wherever points are wanted, text will do: "0.1 0, 0.2 0.5" (see `points.points`).
"""

import bpy  # noqa: F401  (mathutils and bmesh are there once it is imported)
