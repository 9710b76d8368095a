"""List a corpus's exports for feed-forward trainers: scenes for MapAnything, pairs for DUSt3R.

Writes for each part of the corpus's split, train, val and test:

- <part>/<corpus>_scene_list_<part>.npy: the exports wai, by their paths below the corpus's folder.
  It is MapAnything's list of scenes, whose ROOT is the corpus's folder.
- <part>/waymo_pairs.npz: the exports dust3r, and the pairs of all their views. The folder of the
  part is the ROOT of DUSt3R's and MASt3R's dataset Waymo.

See docs/how-to/train-mapanything.md.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import ListScenes

if __name__ == "__main__":
    program(ListScenes, __doc__)
