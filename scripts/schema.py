"""Write the JSON schemas in configs/schema/, with which editors complete and check YAML files.

They are generated from the models in lightfield/configuration/. Run this after a change there.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import WriteSchemas

if __name__ == "__main__":
    program(WriteSchemas, __doc__)
