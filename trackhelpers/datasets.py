"""Public data that the notebooks use: most are not shipped, but looked for on this machine, else downloaded once and checked; coastlines are shipped."""

import functools
import hashlib
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pooch


class Source(NamedTuple):
    """Where a file comes from, the sha256 that its bytes must have, its licence, and what it is."""

    url: str
    sha256: str
    licence: str
    about: str


LIDAR_RADAR_LOG = "obj_pose-laser-radar-synthetic-input.txt"

SOURCES = {
    LIDAR_RADAR_LOG: Source(
        url=f"https://github.com/udacity/CarND-Extended-Kalman-Filter-Project/raw/389e5ad/data/{LIDAR_RADAR_LOG}",
        sha256="ce3885a4eed9adf1bc313e0d113b8570945876f506d6194e1bd4cde8f36b3a9c",
        licence="MIT",
        about="500 simulated measurements of one target by a lidar and a radar in turn, with the true state beside each.",
    ),
}


def path(name):
    """Return the path of the public file `name`, downloading it if need be.

    The folder named by the environment variable TRACKHELPERS_DATA is looked in first, then pooch's cache, then the source's address.

    Raises
    ------
    ValueError
        If `name` is not in SOURCES, or the bytes found or downloaded do not have the sha256 stated there.
    OSError
        If the file is in neither folder and cannot be downloaded.
    """
    source = _source(name)
    folder = os.environ.get("TRACKHELPERS_DATA")
    if folder and (Path(folder) / name).is_file():
        found = Path(folder) / name
        sha256 = pooch.file_hash(str(found))
        if sha256 != source.sha256:
            unix = hashlib.sha256(found.read_bytes().replace(b"\r\n", b"\n")).hexdigest()
            why = ": its line ends were turned into CRLF, copy it byte by byte" if unix == source.sha256 else ""
            raise ValueError(f"{found} (from TRACKHELPERS_DATA) has sha256 {sha256}, expected {source.sha256}{why}")
        return found
    cache = pooch.create(
        path=pooch.os_cache("trackhelpers"),
        base_url="",
        registry={name: f"sha256:{source.sha256}"},
        urls={name: source.url},
        retry_if_failed=0,
    )
    pooch.get_logger().setLevel("WARNING")  # its notice of a download would stand in a notebook as stderr
    try:
        return Path(cache.fetch(name, downloader=pooch.HTTPDownloader(timeout=10)))
    except OSError as error:
        raise OSError(
            f"{name} could not be downloaded from {source.url} ({type(error).__name__}); "
            "fetch it by other means and name its folder in the environment variable TRACKHELPERS_DATA"
        ) from error


def available(name):
    """Return whether :func:`path` can give the file `name` (bool); a download is tried, but only once a process.

    Raises
    ------
    ValueError
        If `name` is not in SOURCES.
    """
    return why_not(name) is None


def why_not(name):
    """Return why :func:`path` cannot give the file `name`, as text, or None if it can; a download is tried, but only once a process.

    Raises
    ------
    ValueError
        If `name` is not in SOURCES.
    """
    _source(name)
    return _why_not(name, os.environ.get("TRACKHELPERS_DATA"))


@functools.cache
def _why_not(name, folder):  # `folder` is part of the key alone: another folder deserves another look
    try:
        path(name)
    except (OSError, ValueError) as error:
        return str(error)
    return None


def _source(name):
    if not isinstance(name, str) or name not in SOURCES:
        raise ValueError(f"name={name!r} is not a known data set, expected one of {sorted(SOURCES)}")
    return SOURCES[name]


def lidar_radar_log():
    """Return the public lidar/radar log as a DataFrame of 500 rows in the order of time.

    Columns: sensor ("L" or "R"); t, s from the first sample; z1, z2, z3, the measurement: x, y in m and NaN for the lidar, range in m,
    bearing in rad and range rate in m/s for the radar; the truth x, y (m), vx, vy (m/s), yaw (rad), yaw_rate (rad/s).

    Raises
    ------
    OSError, ValueError
        As :func:`path`.

    Source: the course project CarND-Extended-Kalman-Filter-Project (Udacity, MIT), the log behind the thesis's Table 5.
    """
    rows = [line.split() for line in path(LIDAR_RADAR_LOG).read_text(encoding="ascii").splitlines()]
    first = min(int(row[_width(row) + 1]) for row in rows)
    columns = ["t", "z1", "z2", "z3", "x", "y", "vx", "vy", "yaw", "yaw_rate"]
    numbers = np.full((len(rows), len(columns)), np.nan)
    for i, row in enumerate(rows):
        m = _width(row)
        numbers[i, 0] = (int(row[m + 1]) - first) / 1e6  # whole microseconds since 1970 until here, so that nothing is rounded away
        numbers[i, 1 : m + 1] = row[1 : m + 1]
        numbers[i, 4:] = row[m + 2 :]
    log = pd.DataFrame(numbers, columns=columns)
    log.insert(0, "sensor", [row[0] for row in rows])
    return log


def coastline():
    """Coastlines of 105–165° E, 0–50° N for figures: a list of arrays (2, k), longitude and latitude in degrees, one a line; shipped with the package.

    Source: Natural Earth (public domain); the head of data/coastline.csv tells how it was cut.
    """
    points = np.loadtxt(Path(__file__).parent / "data" / "coastline.csv", delimiter=",", skiprows=5)
    return np.split(points[:, 1:].T, np.flatnonzero(np.diff(points[:, 0])) + 1, axis=1)


def _width(row):
    """Number of components of the measurement in a line of the log."""
    return {"L": 2, "R": 3}[row[0]]
