"""Pack a finished dataset as tar archives with a card. The same files give the same bytes.

A settings file is JSON: {"gigabytes": 4, "scene": {"licence": "CC0-1.0"}}. `gigabytes` is the
largest size of a part. `scene` has the keys description, licence and credit of the scene YAML.
"""

from lightfield.engine.flags import program
from lightfield.stages.publishing import Package

if __name__ == "__main__":
    program(Package, __doc__)
