"""Write a transforms.json, with which instant-ngp opens a dataset."""

import argparse

from lightfield.core.cli import run
from lightfield.export import instant_ngp


def main() -> None:
    parser = argparse.ArgumentParser(
        description=instant_ngp.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    instant_ngp.add_arguments(parser)
    instant_ngp.export(parser.parse_args())


if __name__ == "__main__":
    run(main)
