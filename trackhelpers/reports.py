"""Position reports as they come from a receiver, and what is wrong with them: each fault found with its row, and kept, dropped, mended or refused by choice."""

import numpy as np
import pandas as pd

from .charts import ecef
from .checks import check_positive

__all__ = ["CHOICES", "clean"]

CHOICES = {  # fault -> what may be done about it, the default first
    "nan": ("drop", "keep", "refuse"),
    "course": ("refuse", "mend", "drop"),
    "frozen": ("drop", "keep", "refuse"),
    "repeated": ("drop", "keep", "refuse"),
    "backwards": ("refuse", "drop", "mend"),
    "jump": ("drop", "keep", "refuse"),
    "rounded": ("keep", "mend", "refuse"),
}
LEAST_TAIL = 10  # rows of one position, course and speed at the end, from which on they are called frozen
MOST_JUMPS = 10  # in a row: then it is not clear which reports are wrong
AIS_WRAP = 409.6  # degrees: a course of 12 bits in tenths of a degree that was stored with a sign


def clean(reports, fastest, **choices):
    """Look for the faults of a table of reports in the order of `CHOICES`, and do about each what is chosen.

    Parameters
    ----------
    reports : pandas.DataFrame
        Columns t (s), lat, lon (degrees), and perhaps speed and course (degrees, clockwise from north), in the order in which the reports came in.
    fastest : float
        Speed that the target cannot exceed, m/s.
    **choices : str
        A fault's name and what to do:

        * nan: a report without time or position: "drop", "keep" (to the filter a scan missed) or "refuse";
        * course: outside [0, 360): "refuse", "mend" (a negative one is raised by 409.6, the range of AIS's field) or "drop";
        * frozen: ten rows or more at the end that say the same in everything but time: "drop", "keep" or "refuse";
        * repeated: the position of the report before, to the last digit: "drop", "keep" or "refuse";
        * backwards: a time before an earlier report's: "refuse", "drop" or "mend" (put in order);
        * jump: farther from the last good report than `fastest` allows, a second granted for rounded times: "drop", "keep" or "refuse";
        * rounded: all times are whole seconds: "keep", "mend" (a column time_sigma, the 1/√12 s by which a time then is uncertain) or "refuse".

    Returns
    -------
    cleaned : pandas.DataFrame
        What is left, with its index of before.
    found : pandas.DataFrame
        Columns row (of the index; the first one for what concerns all), fault, what, done: one line a fault, kept ones too.

    Raises
    ------
    ValueError
        For a fault that is to be refused, with its row; for a fault or a choice that does not exist, columns that are missing, and more than ten jumps in a row.
    """
    if not isinstance(reports, pd.DataFrame):
        raise ValueError(f"reports: expected a DataFrame with the columns t, lat and lon, got {reports!r}")
    missing = {"t", "lat", "lon"} - set(reports.columns)
    if missing:
        raise ValueError(f"reports: expected the columns t, lat and lon, got {list(reports.columns)}")
    for column in ("t", "lat", "lon", "speed", "course"):
        if column in reports and reports[column].dtype.kind not in "iuf":
            raise ValueError(f"reports: expected numbers in the column {column}, got {reports[column].dtype}")
    fastest = check_positive(fastest, "fastest", "a positive speed in m/s")
    for fault, choice in choices.items():
        if not isinstance(choice, str) or choice not in CHOICES.get(fault, ()):
            raise ValueError(f"{fault}={choice!r}: expected a fault out of {list(CHOICES)} with {CHOICES.get(fault, 'one of its choices')}")
    frame, found = reports.copy(), []
    for fault, allowed in CHOICES.items():
        choice = choices.get(fault, allowed[0])
        rows = _FINDERS[fault](frame, fastest)
        if len(rows) and choice == "refuse":
            row, what = next(iter(rows.items()))
            raise ValueError(f"reports: row {row}: {fault}: {what}; {fault}= takes {', '.join(allowed)}")
        found += [(row, fault, what, choice) for row, what in rows.items()]
        if choice == "drop":
            frame = frame.drop(index=list(rows))
        elif choice == "mend" and len(rows):
            frame = _MENDERS[fault](frame, list(rows))
    return frame, pd.DataFrame(found, columns=["row", "fault", "what", "done"])


def _nan(frame, fastest):
    bad = frame[["t", "lat", "lon"]].isna()
    return {row: f"no {', '.join(bad.columns[lack])}" for row, lack in bad[bad.any(axis=1)].iterrows()}


def _course(frame, fastest):
    if "course" not in frame:
        return {}
    bad = frame["course"][(frame["course"] < 0) | (frame["course"] >= 360)]
    return {row: f"course {value:g}" for row, value in bad.items()}


def _mended_course(frame, rows):
    raised = frame.loc[rows, "course"] + AIS_WRAP
    wrong = raised[(raised < 0) | (raised >= 360)]
    if len(wrong):
        raise ValueError(
            f"reports: row {wrong.index[0]}: course {wrong.iloc[0] - AIS_WRAP:g} is none of AIS's, expected it in [-409.6, -49.6)"
        )
    return frame.assign(course=frame["course"].where(~frame.index.isin(rows), frame["course"] + AIS_WRAP))


def _frozen(frame, fastest):
    said = frame.drop(columns="t").to_numpy(dtype=float)
    same = np.all((said == said[-1:]) | (np.isnan(said) & np.isnan(said[-1:])), axis=1)
    tail = len(same) if same.all() else int(np.argmin(same[::-1]))
    if tail <= LEAST_TAIL:
        return {}
    return dict.fromkeys(frame.index[len(same) - tail + 1 :], "as the row before, to the end")


def _repeated(frame, fastest):
    same = (frame[["lat", "lon"]].diff() == 0).all(axis=1) & ~frame.index.isin(list(_frozen(frame, fastest)))
    return dict.fromkeys(frame.index[same], "the position of the row before")


def _backwards(frame, fastest):
    latest = frame["t"].cummax().shift()
    bad = frame["t"] < latest
    return {row: f"t={frame.at[row, 't']:g} s after {latest[row]:g} s" for row in frame.index[bad]}


def _sorted(frame, rows):
    return frame.sort_values("t", kind="stable")


def _jump(frame, fastest):
    known = frame.dropna(subset=["t", "lat", "lon"])
    where, t = ecef(np.radians(known["lat"].to_numpy()), np.radians(known["lon"].to_numpy())), known["t"].to_numpy()
    found, last, in_a_row = {}, 0, 0
    for i in range(1, len(known)):
        apart, after = np.linalg.norm(where[:, i] - where[:, last]), abs(t[i] - t[last])
        if apart <= fastest * (after + 1.0):
            last, in_a_row = i, 0
            continue
        found[known.index[i]], in_a_row = f"{apart:.0f} m in {after:g} s", in_a_row + 1
        if in_a_row > MOST_JUMPS:
            first = known.index[last]
            raise ValueError(
                f"reports: row {first}: more than {MOST_JUMPS} rows in a row lie farther from it than {fastest:g} m/s allow, so it may be the wrong one"
            )
    return found


def _rounded(frame, fastest):
    t = frame["t"].dropna()
    return {t.index[0]: "all times are whole seconds"} if len(t) and (t % 1 == 0).all() else {}


def _with_time_sigma(frame, rows):
    return frame.assign(time_sigma=1 / np.sqrt(12))


_FINDERS = {
    "nan": _nan,
    "course": _course,
    "frozen": _frozen,
    "repeated": _repeated,
    "backwards": _backwards,
    "jump": _jump,
    "rounded": _rounded,
}
_MENDERS = {"course": _mended_course, "backwards": _sorted, "rounded": _with_time_sigma}
