"""Write a finished dataset as it is published: WebDataset shards, and descriptions of them.

The descriptions are a card for Hugging Face, and Croissant. The scene YAML's key
`publish` says what only the author knows. The same files give the same bytes.

A settings file is JSON with the same keys as package.py's settings file.
"""

from lightfield.engine.flags import program
from lightfield.stages.publishing import Publish

if __name__ == "__main__":
    program(Publish, __doc__)
