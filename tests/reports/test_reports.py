"""Each fault of a report is found with its row, and what is done about it was chosen."""

import numpy as np
import pandas as pd
import pytest

from trackhelpers import recordings
from trackhelpers.reports import CHOICES, clean


def table(n=30):
    """A target on a straight line northwards at about 10 m/s, every 1.5 s; the index begins at 100."""
    t = 1.5 * np.arange(n)
    frame = pd.DataFrame({"t": t, "lat": 60 + 9e-5 * t, "lon": np.full(n, 20.0), "speed": 10.0, "course": 0.0})
    return frame.set_index(np.arange(100, 100 + n))


def spoiled(fault):
    frame = table()
    if fault == "nan":
        frame.loc[105, "lat"] = np.nan
    elif fault == "course":
        frame.loc[105, "course"] = -60.6
    elif fault == "frozen":
        frame.loc[119:, ["lat", "lon"]] = frame.loc[118, ["lat", "lon"]].to_numpy()
    elif fault == "repeated":
        frame.loc[105, ["lat", "lon"]] = frame.loc[104, ["lat", "lon"]].to_numpy()
    elif fault == "backwards":
        frame.loc[105, "t"] = 1.0
        frame.loc[105, "lat"] = 60 + 9e-5
    elif fault == "jump":
        frame.loc[105, "lon"] = 20.1
    elif fault == "rounded":
        frame["t"] *= 2
    return frame


def test_sound_reports_come_back_as_they_are():
    cleaned, found = clean(table(), 20.0)
    pd.testing.assert_frame_equal(cleaned, table())
    assert found.empty and list(found.columns) == ["row", "fault", "what", "done"]


@pytest.mark.parametrize("fault", CHOICES)
def test_a_fault_is_found_with_its_row_and_refused_by_name(fault):
    with pytest.raises(ValueError, match=rf"row \d+: {fault}:.*{fault}= takes"):
        clean(spoiled(fault), 20.0, **{"backwards": "drop", fault: "refuse"})


@pytest.mark.parametrize(("fault", "choice"), [(fault, choice) for fault in CHOICES for choice in CHOICES[fault] if choice != "refuse"])
def test_a_fault_is_kept_dropped_or_mended(fault, choice):
    before = spoiled(fault)
    copy = before.copy()
    cleaned, found = clean(before, 20.0, **{fault: choice})
    pd.testing.assert_frame_equal(before, copy)
    own = found[found["fault"] == fault]
    rows = {"frozen": list(range(119, 130)), "rounded": [100]}.get(fault, [105])
    assert own["row"].tolist() == rows and set(own["done"]) == {choice} and set(found["fault"]) == {fault}
    assert set(cleaned.index) == set(before.index) - (set(rows) if choice == "drop" else set())


def test_what_is_mended_is_right():
    assert clean(spoiled("course"), 20.0, course="mend")[0].at[105, "course"] == pytest.approx(349.0)
    assert clean(spoiled("backwards"), 20.0, backwards="mend")[0]["t"].is_monotonic_increasing
    assert clean(spoiled("rounded"), 20.0, rounded="mend")[0]["time_sigma"].unique() == pytest.approx([1 / np.sqrt(12)])


def test_a_course_that_is_no_wrapped_one_cannot_be_mended():
    frame = table()
    frame.loc[110, "course"] = -10.0
    with pytest.raises(ValueError, match="row 110"):
        clean(frame, 20.0, course="mend")


def test_many_jumps_in_a_row_are_not_decided():
    frame = table()
    frame.loc[105:, "lon"] = 20.1
    with pytest.raises(ValueError, match=r"row 104.*wrong one"):
        clean(frame, 20.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"reports": table().drop(columns="lat")}, "columns t, lat and lon"),
        ({"fastest": 0.0}, "fastest"),
        ({"fastest": np.nan}, "fastest"),
        ({"jump": "mend"}, "jump='mend'"),
        ({"jumps": "drop"}, "jumps='drop'"),
    ],
)
def test_what_cannot_be_done_is_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        clean(**({"reports": table(), "fastest": 20.0} | arguments))


def test_the_frozen_tail_of_the_parabolas_is_found():
    frame = recordings.aircraft("parabolas")
    cleaned, found = clean(frame, 400.0)
    assert found[found["fault"] == "frozen"]["row"].tolist() == list(frame.index[-299:])
    assert cleaned.index[-1] == frame.index[-300]


def test_the_harbour_s_courses_are_those_of_the_tracks():
    mended, _ = clean(recordings.harbour().query("vessel == 2"), 30.0, course="mend")
    assert mended["course"].between(0, 360, inclusive="left").all()
