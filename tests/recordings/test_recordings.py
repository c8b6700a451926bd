"""The recordings are shipped as they were reported, in SI units, with their source and without whom they belong to."""

import numpy as np
import pytest

from trackhelpers import recordings
from trackhelpers.charts import LocalENU, ecef

ALL = {name: recordings.aircraft(name) for name in recordings.AIRCRAFT} | {"yacht": recordings.yacht(), "harbour": recordings.harbour()}


@pytest.mark.parametrize("name", ALL)
def test_every_recording_tells_its_source_and_nobody_s_name(name):
    frame = ALL[name]
    about = " ".join(frame.attrs["about"])
    assert "Source:" in about and "licence" in about and "Cut:" in about
    assert not {"callsign", "icao24", "MMSI", "VesselName"} & set(frame.columns)
    assert all(dtype.kind in "if" for dtype in frame.dtypes)


@pytest.mark.parametrize("name", [*recordings.AIRCRAFT, "yacht"])
def test_speed_and_course_are_those_of_the_positions(name):
    """In the median over a minute: units, directions and order of the columns are right."""
    frame = ALL[name].drop_duplicates("t").reset_index(drop=True)
    frame = frame[frame["speed"] > 2.0]
    chart = LocalENU(*np.radians(frame[["lat", "lon"]].iloc[len(frame) // 2]))
    p = chart.to_chart(ecef(*np.radians(frame[["lat", "lon"]].to_numpy().T)))[:2]
    step = p[:, 10:] - p[:, :-10]
    dt = frame["t"].to_numpy()[10:] - frame["t"].to_numpy()[:-10]
    moved = np.linalg.norm(step, axis=0)
    short = (dt < 40) & (dt > 5) & (moved > 0)
    heading = recordings.heading_of(frame["course"].to_numpy()[5:-5])
    ratio = (moved / dt / frame["speed"].to_numpy()[5:-5])[short]
    assert abs(np.median(ratio) - 1) < 0.03
    along = (step[0] * np.cos(heading) + step[1] * np.sin(heading))[short] / moved[short]
    assert np.median(along) > 0.99


def test_the_reported_turn_rate_is_the_derivative_of_the_heading():
    frame = ALL["parabolas"].iloc[:-300]
    heading = np.unwrap(recordings.heading_of(frame["course"]))
    rate = (heading[10:] - heading[:-10]) / 10
    assert np.corrcoef(rate, frame["turn_rate"].to_numpy()[5:-5])[0, 1] > 0.85


def test_a_quarter_of_the_harbour_s_courses_are_negative():
    assert 0.2 < (ALL["harbour"]["course"] < 0).mean() < 0.3
    assert ALL["harbour"]["vessel"].nunique() == 37


def test_an_unknown_aircraft_is_named():
    with pytest.raises(ValueError, match=r"circuits.*balloon"):
        recordings.aircraft("balloon")
