"""The README's summary of the ledger, generated from the committed files."""

from .files import committed_folder, read_ledger, summary_markdown

__all__ = ["in_step", "main", "with_summary"]

START, END = "<!-- ledger:start -->", "<!-- ledger:end -->"


def with_summary(text, ledger):
    """Return a README's `text` with the summary of `ledger` between its two marks.

    Raises
    ------
    ValueError
        When the marks are not there, once each and in this order.
    """
    before, start, rest = text.partition(START)
    _, end, after = rest.partition(END)
    if not end or START in rest or END in before + after:
        raise ValueError(f"text has no block from {START} to {END}, expected exactly one")
    return f"{before}{start}\n\n{summary_markdown(ledger)}\n{end}{after}"


def in_step(text, ledger):
    """Return whether the block of a README's `text` is the summary of `ledger`."""
    return with_summary(text, ledger) == text


def main(arguments, readme=None, folder=None):
    """Rewrite the README's block (``readme``) or see whether it is in step (``check``); return the exit status."""
    if list(arguments) not in (["readme"], ["check"]):
        print("usage: python -m trackhelpers.ledger readme|check")
        return 2
    readme = committed_folder().parents[1] / "README.md" if readme is None else readme
    text, ledger = readme.read_text(encoding="utf-8"), read_ledger(folder)
    if in_step(text, ledger):
        return 0
    if list(arguments) == ["check"]:
        print(f"{readme.name} is out of step with the ledger: run python -m trackhelpers.ledger readme")
        return 1
    readme.write_text(with_summary(text, ledger), encoding="utf-8", newline="\n")
    return 0
