"""Count the members of a family that are built. List those that failed, and fail if there are any.

The settings file is JSON: {"family": "chairs", "records": ["work/chairs/batches/seeds_0_31.json"]}.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_json, write_text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--failed",
        required=True,
        type=Path,
        help="text file to write: the failed members, with their errors",
    )
    parser.add_argument(
        "--output", required=True, type=Path, help="JSON to write if no member failed"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for it.
    from lightfield.configuration.family import summary
    from lightfield.configuration.job_settings import CountSettings
    from lightfield.core.settings import read_settings

    settings = read_settings(CountSettings, arguments.settings)
    members = {}
    for path in settings.records:
        members |= read_keys(path, "build_members.py", "members")["members"]
    failures = [
        (name, member["failure"]["stage"], member["failure"]["cause"])
        for name, member in sorted(members.items())
        if member["state"] == "failed"
    ]
    text = summary(
        settings.family,
        len(members) - len(failures),
        [(name, cause) for name, _, cause in failures],
        str(arguments.failed),
    )
    if failures:
        write_text(arguments.failed, "".join(f"{': '.join(row)}\n" for row in failures))
        raise UserError(text)
    arguments.failed.unlink(missing_ok=True)
    write_json(arguments.output, {"members": len(members)})
    print(text)


if __name__ == "__main__":
    run(main)
