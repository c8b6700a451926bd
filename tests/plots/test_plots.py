"""A figure is tested through the data it draws."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

from trackhelpers import plots


@pytest.fixture
def ax():
    with plt.rc_context():
        plots.use_style()
        fig, ax = plt.subplots()
        yield ax
        plt.close(fig)


T = np.linspace(0.0, 1.0, 5)


def test_truth_measurement_and_estimate_never_look_alike(ax):
    lines = [
        plots.truth(ax, T, T),
        plots.measured(ax, T, T, "lidar"),
        plots.measured(ax, T, T, "radar"),
        *(plots.estimate(ax, T, T, method=method) for method in range(len(plots.METHODS))),
    ]
    looks = {(to_hex(line.get_color()), line.get_linestyle(), line.get_marker()) for line in lines}
    assert len(looks) == len(lines)
    assert [line.get_label() for line in lines[:4]] == ["truth", "lidar", "radar", "estimate"]
    assert [line.get_linestyle() for line in lines[:4]] == ["-", "None", "None", "-"]
    for line in lines:
        np.testing.assert_array_equal(line.get_xydata(), np.c_[T, T])


def test_keywords_of_the_caller_win(ax):
    line = plots.estimate(ax, T, T, "UKF", method=1, linestyle=":", color="red")
    assert (line.get_linestyle(), line.get_color(), line.get_label()) == (":", "red", "UKF")


def test_band_covers_low_to_high(ax):
    vertices = plots.band(ax, T, T - 1, T + 2).get_paths()[0].vertices
    assert vertices[:, 1].min() == -1 and vertices[:, 1].max() == 3


P_EXAMPLES = [np.diag([4.0, 1.0]), np.array([[2.0, 1.2], [1.2, 1.0]]), np.array([[1.0, -0.9], [-0.9, 3.0]]), np.diag([1.0, 0.0])]


@pytest.mark.parametrize("P", P_EXAMPLES)
@pytest.mark.parametrize(("probability", "radius"), [(0.95, 2.4477468306808166), (1 - np.exp(-0.5), 1.0)])
def test_ellipse_is_the_contour_of_the_chi_square_radius(ax, P, probability, radius):
    ellipse = plots.covariance_ellipse(ax, [1.0, -2.0], P, probability)
    unit = np.exp(1j * np.linspace(0, 2 * np.pi, 37))
    points = ellipse.get_patch_transform().transform(np.c_[unit.real, unit.imag]) - [1.0, -2.0]
    # x = r·L·u runs along the contour for any root L of P, so the second moment of its points over the angle is r²P/2.
    np.testing.assert_allclose(points[:-1].T @ points[:-1] / 36, 0.5 * radius**2 * P, atol=1e-12)


def test_ellipse_holds_its_share_of_a_gaussian(ax):
    P = P_EXAMPLES[1]
    x = np.random.default_rng(1).multivariate_normal([0, 0], P, 20_000)
    ellipse = plots.covariance_ellipse(ax, [0, 0], P, 0.95)
    inside = np.linalg.norm(ellipse.get_patch_transform().inverted().transform(x), axis=1) <= 1
    assert abs(inside.mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20_000)


@pytest.mark.parametrize(
    ("mean", "P", "probability", "words"),
    [
        ([0, 0, 0], np.eye(2), 0.95, "mean"),
        ([0, np.nan], np.eye(2), 0.95, "mean"),
        ([0, 0], np.eye(3), 0.95, "P"),
        ([0, 0], [[1, 0.5], [0, 1]], 0.95, "symmetric"),
        ([0, 0], [[1, 2], [2, 1]], 0.95, "semidefinite"),
        ([0, 0], np.eye(2), 95, "probability.*got 95"),
        ([0, 0], np.eye(2), 0.0, "probability"),
    ],
)
def test_ellipse_refuses_what_is_no_covariance_or_probability(ax, mean, P, probability, words):
    with pytest.raises(ValueError, match=words):
        plots.covariance_ellipse(ax, mean, P, probability)
    assert not ax.patches


def test_nees_plot_draws_the_band_the_mean_and_the_average(ax):
    line = plots.nees_plot(ax, T, 4 + T, (3.0, 5.0), expected=4.0)
    np.testing.assert_array_equal(line.get_ydata(), 4 + T)
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == (3.0, 5.0)
    assert any(np.all(np.asarray(other.get_ydata()) == 4.0) for other in ax.lines if other is not line)


def test_flow_draws_every_box_and_an_arrow_from_edge_to_edge(ax):
    boxes = {"predict": (0, 0, "predict"), "update": (3, 0, "update"), "z": (3, -1, "$z_k$")}
    drawn = plots.flow(ax, boxes, [("predict", "update"), ("z", "update", "y"), ("update", "predict", "k → k+1", 0.3)])
    ax.figure.canvas.draw()
    assert {name: text.get_text() for name, text in drawn.items()} == {name: box[2] for name, box in boxes.items()}
    arrows = [text.arrow_patch for text in ax.texts if getattr(text, "arrow_patch", None)]
    assert len(arrows) == 3
    path = arrows[0].get_path()
    path = arrows[0].get_transform().transform(path.vertices[path.codes != path.CLOSEPOLY])
    start, end = (drawn[name].get_bbox_patch().get_window_extent() for name in ("predict", "update"))
    assert path[:, 0].min() >= start.x1 and path[:, 0].max() <= end.x0
    assert {"y", "k → k+1"} <= {text.get_text() for text in ax.texts}
    inside = ax.get_window_extent()
    assert all(inside.contains(*text.get_window_extent().get_points().mean(axis=0)) for text in drawn.values())


def test_flow_refuses_arrows_to_nowhere(ax):
    with pytest.raises(ValueError, match="'c'"):
        plots.flow(ax, {"a": (0, 0, "a"), "b": (1, 0, "b")}, [("a", "c")])


@pytest.mark.parametrize("call", [lambda ax: plots.measured(ax, T, T, "sonar"), lambda ax: plots.estimate(ax, T, T, method=9)])
def test_unknown_sensors_and_methods_are_refused(ax, call):
    with pytest.raises(ValueError, match="expected"):
        call(ax)


def test_show_puts_out_the_figure_at_150_dpi_then_its_caption_and_closes_it(ax, monkeypatch):
    put_out = []
    monkeypatch.setattr(plots, "display", lambda item: put_out.append((item, ax.figure.get_dpi())))
    plots.show(ax.figure, "4.2-3", "The estimate\n   finds the truth.")
    assert put_out[0] == (ax.figure, 150)
    assert put_out[1][0].data == "**Figure 4.2-3.** The estimate finds the truth."
    assert not plt.fignum_exists(ax.figure.number)


@pytest.mark.parametrize(
    ("number", "caption", "words"), [(3, "text", "number is 3"), ("4.2-3", " ", "caption is ' '"), ("", "text", "number")]
)
def test_show_refuses_a_figure_without_number_or_caption_and_leaves_it_open(ax, number, caption, words):
    with pytest.raises(ValueError, match=words):
        plots.show(ax.figure, number, caption)
    assert plt.fignum_exists(ax.figure.number)
