"""The whole ledger as the start page shows it: folded away by notebook, one line of HTML a row, for the page holds some thousand of them."""

from html import escape

from .numbers import short, shown

__all__ = ["folded"]

HEADS = ("where", "quantity", "paper", "ours", "verdict")
_LEFT = '<td style="text-align: left">'


def folded(ledger):
    """Yield one piece of HTML a notebook, in the order of the ledger: its name and number of rows, which unfold to a table.

    Parameters
    ----------
    ledger : pandas.DataFrame
        As `read_ledger` gives it, all cells text. Numbers are shown with four digits, our interval behind our number, the note under the verdict.
    """
    for name, rows in ledger.groupby("notebook", sort=False):
        head = "".join(f'<th style="text-align: left">{text}</th>' for text in HEADS)
        body = "\n".join(_row(row) for row in rows.to_dict("records"))
        yield f"<details><summary>{escape(name)}, {len(rows)} rows</summary><table>\n<tr>{head}</tr>\n{body}\n</table></details>"


def _row(row):
    ours = escape(shown(row))
    if row["low"]:
        ours += f" [{short(row['low'])}, {short(row['high'])}]"
    verdict = f"<i>{row['verdict']}</i>" + (f"; {escape(row['note'])}" if row["note"] else "")
    cells = escape(row["where"]), escape(row["quantity"]), escape(row["paper"]), ours, verdict
    return "<tr>" + "".join(_LEFT + cell for cell in cells)
