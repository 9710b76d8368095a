"""Reproject views from one lens to another, by a settings file or by SILVR's flags.

A settings file is JSON with the keys of a scene YAML's reprojection. Instead of `format` it has
`formats`, a list. In flags, lengths are in mm. Angles of lenses are in radians, or in degrees as in
120deg. --rotation is in degrees. Settings without a camera, and the flag --no-reproject, keep the
source's lens. Pixels without a source are black, with alpha 0 in a PNG and depth NaN in an EXR. Of
a cube map, only faces that the source sees are written.

Examples, with views in garden/exr and garden/lightfield.json:

  # a perspective of 90 degrees, in 8 bits
  reproject.py -i garden/exr --input-cfg garden/lightfield.json -o flat --rectilinear 18,36 \\
    --output-resolution 512,512 --png --reinhard 5 --output-cfg flat/lightfield.json
  # the middle 120 degrees of the fisheye, turned 30 degrees to the left, with depth
  reproject.py -i garden/exr --input-cfg garden/lightfield.json -o left --equidistant 120deg \\
    --rotation 30,0,0 --exr --output-cfg left/lightfield.json
  # the same by a settings file, {"camera": {"lens": "rectilinear", "fov": 90, "resolution":
  # [512, 512]}, "formats": ["png"], "reinhard": 5}
  reproject.py -i garden/exr --input-cfg garden/lightfield.json -o flat --settings flat.json
  # one photograph of a fisheye of 180 degrees, as the faces of a cube
  reproject.py --single photo.jpg --no-configs 2000,2000 --i-equidistant 180deg -o faces \\
    --cubemap 512 --png
"""

from lightfield.engine.flags import program
from lightfield.stages.lenses import Reproject

if __name__ == "__main__":
    program(Reproject, __doc__)
