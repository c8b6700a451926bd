"""Tables as a notebook shows them: rounded to what is meant, and the same bytes on every run."""

import itertools
import math
import re
from html import escape

import numpy as np
import pandas as pd

from .checks import check_count, check_numbers
from .numerals import as_printed, number, residual_text, without_minus_zero

__all__ = ["Table", "as_printed", "error_table", "matrix", "number", "residual_text", "side_by_side"]


def _cell(value, form):
    if callable(form):
        return str(form(value))
    if isinstance(form, str) and not isinstance(value, str) and not pd.isna(value):
        return without_minus_zero(format(value, form))
    return number(value, form if isinstance(form, int) else 4)


def _is_text(column):
    """Whether a column reads as prose, to be set flush left."""
    texts = [value for value in column if isinstance(value, str)]
    return any(re.search(r"[^\W\d_]{3}", value) for value in texts)


class Table:
    """A table with rounded text in its cells, shown by Jupyter and by ``print`` alike.

    Parameters
    ----------
    data : pandas.DataFrame or anything its constructor takes
    caption : str
    digits : int
        Significant digits of a float in a column without a format of its own.
    formats : dict, optional
        Column -> significant digits (int), a format specification such as ``".2f"``, or a function from value to text.
    index : bool
        Show the row labels.

    Attributes
    ----------
    frame : pandas.DataFrame
        The numbers, not rounded.
    text : pandas.DataFrame
        The strings that are shown.

    Raises
    ------
    ValueError
        When `formats` names a column that is not there, or `digits` is not a positive int.
    """

    def __init__(self, data, caption="", digits=4, formats=None, index=True):
        self.frame = data.frame if isinstance(data, Table) else pd.DataFrame(data)
        self.caption = caption
        self.shows_index = index
        formats = dict(formats or {})
        unknown = [name for name in formats if name not in self.frame.columns]
        if unknown:
            raise ValueError(f"formats names {unknown}, expected some of the columns {list(self.frame.columns)}")
        digits = check_count(digits, "digits")
        forms = [formats.get(name, int(digits)) for name in self.frame.columns]
        columns = [[_cell(value, form) for value in self.frame.iloc[:, j]] for j, form in enumerate(forms)]
        rows = list(zip(*columns, strict=True)) if columns else []
        index = self.frame.index
        labels = [number(label, trim=True) for label in index] if pd.api.types.is_float_dtype(index.dtype) else index
        self.text = pd.DataFrame(rows, index=labels, columns=self.frame.columns, dtype=object)
        self.text.index.names = index.names

    def __repr__(self):
        body = self.text.to_string(index=self.shows_index)
        return f"{self.caption}\n{body}" if self.caption else body

    def _repr_html_(self):
        with pd.option_context("display.max_colwidth", None):
            body = self.text.to_html(index=self.shows_index, border=0, escape=True)
        sides = ["left" if _is_text(column) else "right" for _, column in self.frame.items()]
        aligned = itertools.cycle(sides)  # a row of the body has one <td> a column; its labels are <th>
        body = re.sub("<td>", lambda cell: f'<td style="text-align: {next(aligned)}">', body)
        if self.text.columns.nlevels == 1:
            heads = iter(["left"] * (self.shows_index * self.text.index.nlevels) + sides)
            top, end, rest = body.partition("</tr>")  # the row of headings; a row with the names of the labels may follow
            body = re.sub("<th>", lambda cell: f'<th style="text-align: {next(heads)}">', top) + end + rest
        head = f'<caption style="caption-side: top; text-align: left">{escape(self.caption)}</caption>' if self.caption else ""
        return body.replace("\n", f"\n  {head}\n", 1) if head else body


def error_table(errors, names=None):
    """Return the root mean square, largest, smallest and mean absolute error of each component (the thesis's Table 9).

    Parameters
    ----------
    errors : array (n, N), dict or pandas.DataFrame of name -> (N,)
        Estimate minus truth: n components, N samples. A one-dimensional array is one component.
    names : sequence of str, optional
        Names of the components of an array; of a dict or a DataFrame the components to take, in this order.

    Returns
    -------
    pandas.DataFrame
        Rows ``RMSE``, ``max``, ``min``, ``mean``; one column a component, in the unit of its errors.

    Raises
    ------
    ValueError
        For errors that are empty, not finite or of a wrong shape, and for names that are repeated, unknown or of a wrong number.
    """
    if names is not None:
        if not isinstance(names, (list, tuple, pd.Index, np.ndarray)):
            raise ValueError(f"names is {names!r}, expected a sequence of names")
        names = list(names)
        if len(set(names)) != len(names):
            raise ValueError(f"names is {names}, expected no name twice")
    if isinstance(errors, (dict, pd.DataFrame)):
        unknown = [name for name in names or [] if name not in errors]
        if unknown:
            raise ValueError(f"names has {unknown}, expected some of those of errors, {list(errors)}")
        names = list(errors) if names is None else names
        components = [_finite(errors[name], f"errors[{name!r}]", 1) for name in names]
    else:
        components = _finite(np.atleast_2d(check_numbers(errors, "errors")), "errors", 2)
        names = list(range(len(components))) if names is None else names
        if len(names) != len(components):
            raise ValueError(f"names is {names}, expected one for each of the {len(components)} components of errors")
    if not names:
        raise ValueError("errors is empty, expected at least one component")
    sizes = [np.abs(component) for component in components]
    figures = [[np.sqrt(np.mean(size**2)), size.max(), size.min(), size.mean()] for size in sizes]
    return pd.DataFrame(np.transpose(figures), index=["RMSE", "max", "min", "mean"], columns=names)


def side_by_side(paper, ours, low=None, high=None, caption="", digits=None):
    """Return the paper's table and ours, cell beside cell.

    Parameters
    ----------
    paper : pandas.DataFrame
        Printed strings, as `trackhelpers.published.published` gives them, or numbers.
    ours, low, high : pandas.DataFrame
        Our numbers, and if wanted both ends of their interval, with the same row and column labels in any order.
    caption : str
    digits : int, optional
        Significant digits of our numbers; without it they are written in the manner of the printed cell beside them.

    Returns
    -------
    Table
        Under each heading the columns ``paper``, ``ours`` and, where an interval is given, ``low`` and ``high``.

    Raises
    ------
    ValueError
        When the labels differ, are repeated, or only one end of the interval is given.
    """
    if (low is None) != (high is None):
        raise ValueError("low and high: expected both or neither")
    for name, part in (("paper", paper), ("ours", ours), ("low", low), ("high", high)):
        if not isinstance(part, pd.DataFrame) and not (part is None and name in ("low", "high")):
            raise ValueError(f"{name} is {part!r}, expected a DataFrame")
    ours_parts = {name: part for name, part in (("ours", ours), ("low", low), ("high", high)) if part is not None}
    for axis in (0, 1):
        labels = paper.axes[axis]
        if not labels.is_unique:
            raise ValueError(f"paper has repeated labels {list(labels)}")
        for name, part in ours_parts.items():
            if len(labels) != len(part.axes[axis]) or set(labels) != set(part.axes[axis]):
                raise ValueError(f"{name} has the labels {list(part.axes[axis])}, expected those of paper, {list(labels)}")
    columns = {}
    for name in paper.columns:
        columns[name, "paper"] = [number(cell) for cell in paper[name]]
        for part_name, part in ours_parts.items():
            cells = part.loc[paper.index, name]
            columns[name, part_name] = [_beside(value, cell, digits) for value, cell in zip(cells, paper[name], strict=True)]
    text = pd.DataFrame(columns, index=paper.index)
    text.columns = pd.MultiIndex.from_tuples(columns)
    return Table(text, caption=caption)


def _beside(value, printed, digits):
    if digits is None and isinstance(printed, str) and isinstance(value, (float, np.floating)) and math.isfinite(value):
        return as_printed(value, printed)
    return number(value, digits or 4)


def matrix(M, names=None, digits=4, rows=None, columns=None, caption=""):
    """Return a matrix as a table with named rows and columns.

    Parameters
    ----------
    M : array (n, m) or (n,)
        A vector is shown as one column.
    names : sequence of str, optional
        Names of both the rows and the columns; `rows` and `columns` name them apart.
    digits : int
        Significant digits. Trailing zeros are left out, and what is below 1e-13 of the largest entry is shown as 0.

    Raises
    ------
    ValueError
        When `M` has another shape, is empty or not finite, or a list of names does not fit it.
    """
    M, digits = check_numbers(M, "M"), check_count(digits, "digits")
    vector = M.ndim == 1
    M = _finite(M[:, None] if vector else M, "M", 2)
    rows = names if rows is None else rows
    columns = ([""] if vector else names) if columns is None else columns
    rows, columns = ([""] * size if given is None else list(given) for given, size in zip((rows, columns), M.shape, strict=True))
    if (len(rows), len(columns)) != M.shape:
        raise ValueError(f"rows and columns are {rows} and {columns}, expected {M.shape[0]} and {M.shape[1]} names")
    floor = 1e-13 * np.abs(M).max()
    text = [[number(0.0 if abs(value) < floor else value, digits, trim=True) for value in row] for row in M.tolist()]
    return Table(pd.DataFrame(text, index=rows, columns=columns), caption=caption)


def _finite(values, name, ndim):
    values = check_numbers(values, name)
    if values.ndim != ndim or values.size == 0:
        raise ValueError(f"{name} has the shape {values.shape}, expected {ndim} axes and at least one entry")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has {np.count_nonzero(~np.isfinite(values))} NaN or infinite entries, expected finite numbers")
    return values
