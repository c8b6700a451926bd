"""The page of symbols names what there is: every name of its two columns of code is looked up on a real object."""

import importlib

import filterpy.kalman
import filterpy.stats
import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints

from trackhelpers import charts, consistency, filters, fixes, fusion, motion, sensors
from trackhelpers.suite import book, written
from trackhelpers.suite.letters import COLUMNS, FILE, read_symbols, symbols_page

ROWS = read_symbols()
MODULES = {module.__name__.rpartition(".")[2]: module for module in (charts, consistency, filters, fixes, fusion, motion, sensors)}


def objects():
    """One object of every class that the table names, after a step where it is a filter."""
    cv, ca, ctrv = motion.CV(1.0), motion.CA(1.0), motion.CTRV(sigma_a=2.0, sigma_w=0.3)
    x4, start = np.zeros(4), np.array([3.0, 4.0, 5.0, 0.6, 0.1])
    linear = (cv.F(x4, 1.0), np.eye(4)[::2], cv.Q(x4, 1.0), np.eye(2))
    many = {
        "MotionKF": filters.MotionKF(cv, x4, np.eye(4)),
        "MotionEKF": filters.MotionEKF(ctrv, start, np.eye(5)),
        "MotionUKF": filters.MotionUKF(ctrv, start, np.eye(5)),
        "MatrixKF": filters.MatrixKF(*linear, x4, np.eye(4)),
        "StrongTrackingKF": filters.StrongTrackingKF(*linear, x4, np.eye(4)),
        "AugmentedBiasKF": filters.AugmentedBiasKF(*linear, 0.01 * np.eye(4), x4, np.eye(4)),
        "ManoeuvreIMM": filters.ManoeuvreIMM(cv, ca, np.eye(2), 1.0, x4, np.eye(4)),
        "MotionIMM": filters.MotionIMM([filters.MotionKF(cv, x4, np.eye(4)) for _ in "ab"], [0.5, 0.5], [[0.9, 0.1], [0.1, 0.9]]),
        "SquareRootUKF": square_root(),
        "CV": cv,
        "CA": ca,
        "CTRV": ctrv,
        "CTRA": motion.CTRA(sigma_j=1.0, sigma_w=0.3),
        "CSAV": motion.CSAV(wheelbase=3.0, sigma_a=1.0, sigma_phi=0.1),
        "Singer": motion.Singer(1.0, 20.0),
        "Lidar": sensors.Lidar(),
        "Radar": sensors.Radar(),
        "TDOA": sensors.TDOA(24.0, np.diag([0.0, 5e6, 4e6]) + 1e6, charts.Ellipsoid(), ("x", "y", "vx", "vy")),
        "Ellipsoid": charts.Ellipsoid(),
    }
    many["MotionEKF"].predict(0.1)
    many["MotionEKF"].update([5.0, 0.9, 1.0], sensors.Radar())
    return many


def square_root():
    points = MerweScaledSigmaPoints(2, 1.0, 2.0, 0.0)
    return filters.SquareRootUKF(2, 1, 1.0, lambda x: x[:1], lambda x, dt: x, points)


def of_filterpy():
    points = MerweScaledSigmaPoints(2, 1.0, 2.0, 0.0)
    kf = filterpy.kalman.KalmanFilter(dim_x=2, dim_z=1, dim_u=1)
    return {
        "KalmanFilter": kf,
        "ExtendedKalmanFilter": filterpy.kalman.ExtendedKalmanFilter(2, 1),
        "UnscentedKalmanFilter": filterpy.kalman.UnscentedKalmanFilter(2, 1, 1.0, lambda x: x, lambda x, dt: x, points),
        "IMMEstimator": filterpy.kalman.IMMEstimator([kf, kf], [0.5, 0.5], np.eye(2)),
        "MerweScaledSigmaPoints": points,
    }


@pytest.mark.parametrize("column, made", [("code", objects), ("filterpy", of_filterpy)], ids=["code", "filterpy"])
def test_every_name_is_there_on_a_real_object(column, made):
    known = made()
    named = {name for row in ROWS for name in row[column]}
    missing = []
    for name in sorted(named):
        owner, _, attribute = name.rpartition(".")
        where = known.get(owner) or MODULES.get(owner) or (importlib.import_module(owner) if owner.startswith("filterpy.") else None)
        if where is None or not hasattr(where, attribute):
            missing.append(name)
    assert not missing
    assert not set(known) - {name.rpartition(".")[0] for name in named}, "an object that no name needs"


def test_the_page_has_each_row_once_and_the_papers_words():
    page = symbols_page()
    assert page.count("\n| ") == len(ROWS) + len({row["group"] for row in ROWS}) * 2
    assert all(row["chinese"] in page and row["symbol"] in page for row in ROWS)
    assert not [row for row in ROWS if "|" in "".join(row["symbol"] + row["meaning"])], "a bar would end the cell"


@pytest.mark.parametrize(
    ("text", "words"),
    [("a,b\n", "columns"), (",".join(COLUMNS) + "\nState,1,x\n", "line 2"), (",".join(COLUMNS) + "\n,1,x,state,,,,\n", "line 2")],
)
def test_a_table_that_lacks_something_names_its_line(tmp_path, text, words):
    (tmp_path / FILE.name).write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words):
        read_symbols(tmp_path / FILE.name)


def test_symbols_stand_in_the_table_of_contents(tmp_path):
    (tmp_path / "pages").mkdir()
    text = book.contents(tmp_path)
    assert text.index("The papers, in their own order") < text.index("pages/paper_4") < text.index("To look things up")
    assert all(f"pages/{page}" in text for page in written.LOOK_UP)
