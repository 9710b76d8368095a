"""Write transforms.json for instant-ngp, and the masks and copies of views that it needs.

Frames come in the order and, with --scale and --offset, with the numbers of SILVR's
generate_NERF_transforms.py. instant-ngp reads perspective views, fisheyes and full panoramas.

instant-ngp does not hide the pixels outside a fisheye's image circle by itself. So PNG views with
such pixels get a dynamic_mask_<name>.png beside them. instant-ngp refuses EXR files whose channels
differ in type, as half colour and float depth do. It hides pixels of an EXR only if their colour is
negative. So EXR views are copied to --exr-dir with R, G and B alone.

Give instant-ngp the transforms.json itself. If it gets a folder, it opens every .json in it. It
cannot read lightfield.json.
"""

from lightfield.engine.flags import program
from lightfield.exporters.instant_ngp import TransformsByHand

if __name__ == "__main__":
    program(TransformsByHand, __doc__)
