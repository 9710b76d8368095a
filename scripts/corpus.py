"""Write a family's members as one corpus.

Writes into the family's folder: corpus.json with the members, their split, statistics and failures;
a page with thumbnails; WebDataset shards, if asked for; and sha256sums.txt over everything. Equal
members give equal bytes.

A settings file is JSON: {"family": "chairs", "splits": {"test": 0.2}, "shards": true}.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import Corpus

if __name__ == "__main__":
    program(Corpus, __doc__)
