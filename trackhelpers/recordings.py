"""Recordings of real targets, shipped with the package: four aircraft, a yacht, and the vessels of a harbour, as they were reported."""

from pathlib import Path

import numpy as np
import pandas as pd

from .checks import check_choice, check_numbers

__all__ = ["AIRCRAFT", "FOOT", "KNOT", "aircraft", "harbour", "heading_of", "licence", "yacht"]

KNOT, FOOT = 1852 / 3600, 0.3048  # m/s, m
AIRCRAFT = {
    "circuits": "aircraft_circuits.csv",
    "parabolas": "aircraft_parabolas.csv",
    "tree": "aircraft_tree.csv",
    "helicopter": "helicopter.csv",
}
_FOLDER = Path(__file__).parent / "data"


def aircraft(name):
    """Return the ADS-B reports of one aircraft, in the order in which they stand in the file.

    Parameters
    ----------
    name : {"circuits", "parabolas", "tree", "helicopter"}
        A Boeing 737 in circuits, an Airbus A310 in parabolas, an Airbus A380 that draws a tree, a rescue helicopter.

    Returns
    -------
    pandas.DataFrame
        t (s, as reported: whole seconds), lat, lon (degrees), altitude (m), speed (m/s) over ground and course (degrees, clockwise from north, as reported);
        of the parabolas also roll (rad, right wing down), turn_rate (rad/s, anticlockwise) and airspeed (m/s). ``attrs["about"]`` is the head of the file.
        Nothing is mended; `trackhelpers.reports.clean` does that.

    Raises
    ------
    ValueError
        For another name.
    """
    check_choice(name, "name", AIRCRAFT)
    raw, frame = _read(AIRCRAFT[name])
    frame.insert(3, "altitude", raw["altitude_ft"] * FOOT)
    if "roll_deg" in raw:
        frame["roll"] = np.radians(raw["roll_deg"])
        frame["turn_rate"] = -np.radians(raw["track_rate_deg_s"])  # reported clockwise
        frame["airspeed"] = raw["airspeed_kn"] * KNOT
    return frame


def yacht():
    """Return a sailing yacht's fixes of 4.1 h, one every 2 s: columns t, lat, lon, speed and course as of `aircraft`."""
    return _read("yacht.csv")[1]


def harbour():
    """Return the AIS reports of a harbour's 37 vessels during one hour: vessel (a number), and t, lat, lon, speed and course as of `aircraft`.

    More than a quarter of the courses are negative, as stored: 409.6 degrees too small.
    """
    raw, frame = _read("harbour.csv")
    frame.insert(0, "vessel", raw["vessel"].astype(int))
    return frame


def heading_of(course):
    """Return the direction of motion, rad, anticlockwise from east, of a course in degrees, clockwise from north. ValueError for what is no number."""
    return np.radians(90.0 - check_numbers(course, "course"))


def licence(file):
    """Return the head of a shipped file, a list of lines: what it is, source and licence, how it was cut. ValueError for a file that there is not."""
    check_choice(file, "file", sorted(path.name for path in _FOLDER.glob("*.csv")))
    with open(_FOLDER / file, encoding="utf-8") as lines:
        return [line[2:].rstrip() for line in lines if line.startswith("# ")]


def _read(file):
    """The file as it is, and its common columns in SI units."""
    raw = pd.read_csv(_FOLDER / file, comment="#")
    frame = raw[["t", "lat", "lon"]].astype(float)
    frame["speed"] = raw["speed_kn"] * KNOT
    frame["course"] = raw["track_deg" if "track_deg" in raw else "course_deg"].astype(float)
    frame.attrs["about"] = licence(file)
    return raw, frame
