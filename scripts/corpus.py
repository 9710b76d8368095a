"""Write a family's members as one corpus.

Writes into the family's folder: corpus.json with the members, their split, statistics and failures;
a page with thumbnails; WebDataset shards, if asked for; and sha256sums.txt over all of these. Equal
members give equal bytes. Shards that are there keep their views, and new views follow them.
report/members.jsonl has what each member took, so it differs between builds, and sha256sums.txt
leaves it out.

A settings file is JSON: {"family": "chairs", "splits": {"test": 0.2}, "shards": true}.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import Corpus

if __name__ == "__main__":
    program(Corpus, __doc__)
