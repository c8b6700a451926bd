"""Public data are found or refused without surprises, and the log is what its source says; nothing here needs the network."""

import hashlib

import numpy as np
import pandas as pd
import pooch
import pytest
import requests

from trackhelpers import datasets
from trackhelpers.suite import NOTEBOOKS, missing_data

NAME = datasets.LIDAR_RADAR_LOG
LINES = (
    "L\t1.5\t-2.5\t1477010443000000\t0.5\t0.25\t4\t3\t0\t0.125\nR\t2\t-0.5\t3\t1477010443050000\t1\t2\t3\t4\t5\t6\n"
    "L\t8\t9\t1477010443100000\t1\t2\t3\t4\t5\t6\n"
)


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    """A machine without the data: an empty cache, no folder named, no network. Returns the addresses that were asked for."""
    asked = []

    def refuse(url, **kwargs):
        asked.append((url, kwargs["timeout"]))
        raise requests.exceptions.ConnectionError("no network")

    monkeypatch.delenv("TRACKHELPERS_DATA", raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    monkeypatch.setattr(requests, "get", refuse)
    datasets._why_not.cache_clear()
    yield asked
    datasets._why_not.cache_clear()


@pytest.fixture
def small_log(elsewhere, monkeypatch, tmp_path):
    """The log cut to three lines, in a folder that TRACKHELPERS_DATA names."""
    (tmp_path / NAME).write_bytes(LINES.encode())
    sha256 = hashlib.sha256(LINES.encode()).hexdigest()
    monkeypatch.setitem(datasets.SOURCES, NAME, datasets.SOURCES[NAME]._replace(sha256=sha256))
    monkeypatch.setenv("TRACKHELPERS_DATA", str(tmp_path))
    return tmp_path / NAME


def test_the_named_folder_comes_before_the_network(small_log, elsewhere):
    assert datasets.path(NAME) == small_log
    assert datasets.available(NAME)
    assert elsewhere == []


def test_a_file_with_other_bytes_is_refused_by_name(small_log):
    small_log.write_bytes(LINES.encode() + b"\n")
    with pytest.raises(ValueError, match=rf"{NAME}.*sha256 .*expected"):
        datasets.path(NAME)
    assert not datasets.available(NAME)


def test_the_cache_comes_before_the_network(small_log, elsewhere, monkeypatch, tmp_path):
    cached = tmp_path / "cache" / "trackhelpers" / NAME
    cached.parent.mkdir(parents=True)
    small_log.rename(cached)
    assert datasets.path(NAME) == cached
    assert elsewhere == []


def test_without_network_the_error_says_what_to_do(elsewhere):
    with pytest.raises(OSError, match=rf"{NAME} could not be downloaded .*TRACKHELPERS_DATA"):
        datasets.path(NAME)
    assert elsewhere == [(datasets.SOURCES[NAME].url, 10)]


def test_availability_asks_the_network_once(elsewhere):
    assert not datasets.available(NAME)
    assert not datasets.available(NAME)
    assert len(elsewhere) == 1


@pytest.mark.parametrize("function", [datasets.path, datasets.available])
def test_an_unknown_name_is_refused(function):
    with pytest.raises(ValueError, match=r"name='nothing\.txt'.*expected one of"):
        function("nothing.txt")


def test_log_lines_become_rows(small_log):
    expected = pd.DataFrame(
        [
            ["L", 0.0, 1.5, -2.5, np.nan, 0.5, 0.25, 4.0, 3.0, 0.0, 0.125],
            ["R", 0.05, 2.0, -0.5, 3.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            ["L", 0.1, 8.0, 9.0, np.nan, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        ],
        columns=["sensor", "t", "z1", "z2", "z3", "x", "y", "vx", "vy", "yaw", "yaw_rate"],
    )
    pd.testing.assert_frame_equal(datasets.lidar_radar_log(), expected, check_exact=True)


def test_the_public_log_alternates_and_measures_its_own_truth():
    if (reason := datasets.why_not(NAME)) is not None:
        pytest.skip(f"{NAME}: {reason}")
    log = datasets.lidar_radar_log()
    lidar, radar = log[log.sensor == "L"], log[log.sensor == "R"]
    distance = np.hypot(radar.x, radar.y)
    assert len(log) == 500
    assert "".join(log.sensor) == "LR" * 250
    np.testing.assert_allclose(log.t, 0.05 * np.arange(500), rtol=0, atol=1e-9)
    # The log's noise as its source gives it: 0.15 m; 0.3 m, 0.03 rad, 0.3 m/s. Four standard deviations of 250 samples' deviation are 18 %.
    for measured, true, sigma in (
        (lidar.z1, lidar.x, 0.15),
        (lidar.z2, lidar.y, 0.15),
        (radar.z1, distance, 0.3),
        (np.unwrap(radar.z2), np.unwrap(np.arctan2(radar.y, radar.x)), 0.03),
        (radar.z3, (radar.x * radar.vx + radar.y * radar.vy) / distance, 0.3),
    ):
        assert np.std(measured - true) == pytest.approx(sigma, rel=0.18)


@pytest.mark.parametrize(
    ("change", "words"), [(lambda b: b.replace(b"\n", b"\r\n"), "CRLF"), (lambda b: b.replace(b"1.5", b"1.6"), "has sha256")]
)
def test_a_file_that_was_changed_says_so(small_log, monkeypatch, tmp_path, change, words):
    (tmp_path / NAME).write_bytes(change(LINES.encode()))
    reason = missing_data(NOTEBOOKS / "1_thesis" / "4_3_public_log.ipynb")
    assert words in reason and str(tmp_path / NAME) in reason and NAME in reason
    assert ("CRLF" in reason) == (words == "CRLF")
