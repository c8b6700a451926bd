"""The README's summary of the ledger, generated from the committed files."""

from .files import summary_markdown

__all__ = ["in_step", "with_summary"]

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
