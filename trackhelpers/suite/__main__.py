"""Command line of the suite: ``python -m trackhelpers.suite refresh [notebook …]``, ``… readme``, ``… links``, ``… book``, ``… student`` and ``… lab``."""

import signal

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while the modules are loaded just ends the program, without a traceback

import argparse
import sys
from pathlib import Path

from trackhelpers.suite import NOTEBOOKS, ROOT, book, lab, notebooks, readme, records, student, written
from trackhelpers.suite.run import NotebookError, run


def check_checkout(here):
    """Say which checkout is worked on; FileNotFoundError where the package is not in one, or not in the one that `here` lies in."""
    inside = next((folder for folder in (here, *here.parents) if (folder / "trackhelpers" / "suite").is_dir()), ROOT)
    if inside.resolve() != ROOT:
        raise FileNotFoundError(
            f"this is the checkout {inside}, but the package comes from {ROOT}: use make here, or set PYTHONPATH={inside}"
        )
    if not NOTEBOOKS.is_dir():
        raise FileNotFoundError(f"the package is installed in {ROOT}, without the notebooks: call this in a checkout of the project")
    print(f"Working on {ROOT}")


def main(arguments=None):
    """Run the command and return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m trackhelpers.suite", description="Runs the notebooks and builds the web book.")
    commands = parser.add_subparsers(dest="command", required=True)
    refresh = commands.add_parser("refresh", help="run notebooks in place, store them normalised, and fill marks and pages of rows")
    refresh.add_argument("notebook", nargs="*", type=Path, help="notebooks to run (all of them if none is named)")
    commands.add_parser(
        "readme", help="bring the README, the marks, the written pages and the pages of rows in step with the stored ledger"
    )
    commands.add_parser(
        "links", help="list the written pages' links to rows that are not asked, and the questions that no page of a paper reaches"
    )
    commands.add_parser("book", help="run every notebook afresh and build the web book")
    commands.add_parser("student", help="copy the notebooks without the solutions of their exercises to build/student")
    commands.add_parser("lab", help="open the notebooks in JupyterLab, and store what is saved there in the project's form", add_help=False)
    options, more = parser.parse_known_args(arguments)
    if more and options.command != "lab":
        parser.error(f"unrecognised: {' '.join(more)}")
    try:
        check_checkout(Path.cwd())
        if options.command == "book":
            print(f"The book is built, open {book.build()}")
        elif options.command == "student":
            print(f"Without solutions: {student.copy()}")
        elif options.command == "readme":
            records.write()
            written.write()
            readme.write()
        elif options.command == "links":
            return written.report()
        elif options.command == "lab":
            return lab.serve(more)
        else:
            named = [path.resolve() for path in options.notebook]
            for path in named:
                if not path.is_relative_to(NOTEBOOKS):
                    parser.error(f"{path} does not lie below {NOTEBOOKS}")
            run(named or notebooks(), lambda path: path, results=NOTEBOOKS / "results")
            records.write()
            written.write()
            if not named:
                readme.write()
    except (NotebookError, FileNotFoundError, RuntimeError) as error:
        print(f"\n{error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nInterrupted: what was finished is stored, the rest is as it was.", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())
