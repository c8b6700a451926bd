"""The README's generated blocks, each between a pair of marks; the ledger's summary is one of them."""

from .files import summary_markdown

__all__ = ["replaced", "with_summary"]


def replaced(text, name, body):
    """Return `text` with `body` between the marks ``<!-- name:start -->`` and ``<!-- name:end -->``.

    Raises
    ------
    ValueError
        When the marks are not there, once each and in this order.
    """
    start_mark, end_mark = f"<!-- {name}:start -->", f"<!-- {name}:end -->"
    before, start, rest = text.partition(start_mark)
    _, end, after = rest.partition(end_mark)
    if not end or start_mark in rest or end_mark in before + after:
        raise ValueError(f"text has no block from {start_mark} to {end_mark}, expected exactly one")
    return f"{before}{start}\n\n{body}\n{end}{after}"


def with_summary(text, ledger):
    """Return a README's `text` with the summary of `ledger` between its two marks."""
    return replaced(text, "ledger", summary_markdown(ledger))
