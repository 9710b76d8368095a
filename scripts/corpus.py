"""Write a family's members as one corpus.

Writes into the family's folder: corpus.json with the members, their split, statistics and failures;
a page with thumbnails; WebDataset shards, if asked for; and sha256sums.txt over everything. Equal
members give equal bytes.

A settings file is JSON: {"family": "chairs", "splits": {"test": 0.2}, "shards": true}.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folder", type=Path, help="folder of the family, which holds a folder for each member"
    )
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--cache",
        required=True,
        type=Path,
        metavar="JSON",
        help="JSON that keeps what was computed from the views, so that it is not computed again",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.corpus import CorpusSettings
    from lightfield.core.settings import read_settings
    from lightfield.report import corpus

    settings = read_settings(CorpusSettings, arguments.settings)
    content = corpus.write(arguments.folder, settings, arguments.cache)
    print(corpus.summary(content, arguments.folder))


if __name__ == "__main__":
    run(main)
