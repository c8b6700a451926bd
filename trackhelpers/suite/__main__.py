"""Command line of the suite: ``python -m trackhelpers.suite refresh [notebook …]``, ``… readme`` and ``… book``."""

import argparse
import sys
from pathlib import Path

from trackhelpers.suite import NOTEBOOKS, book, notebooks, readme, records
from trackhelpers.suite.run import NotebookError, run


def main(arguments=None):
    """Run the command and return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m trackhelpers.suite", description="Runs the notebooks and builds the web book.")
    commands = parser.add_subparsers(dest="command", required=True)
    refresh = commands.add_parser("refresh", help="run notebooks in place, store them normalised, and fill marks and pages of rows")
    refresh.add_argument("notebook", nargs="*", type=Path, help="notebooks to run (all of them if none is named)")
    commands.add_parser("readme", help="bring the README, the marks and the pages of rows in step with the stored ledger")
    commands.add_parser("book", help="run every notebook afresh and build the web book")
    options = parser.parse_args(arguments)
    try:
        if options.command == "book":
            print(f"The book is built, open {book.build()}")
        elif options.command == "readme":
            records.write()
            readme.write()
        else:
            named = [path.resolve() for path in options.notebook]
            for path in named:
                if not path.is_relative_to(NOTEBOOKS):
                    parser.error(f"{path} does not lie below {NOTEBOOKS}")
            run(named or notebooks(), lambda path: path)
            records.write()
            if not named:
                readme.write()
    except (NotebookError, FileNotFoundError, RuntimeError) as error:
        print(f"\n{error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
