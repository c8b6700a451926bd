"""Valid calls of data, tables, figures and the ledger."""

from datetime import date
from functools import cache

import numpy as np
import pandas as pd
from bad_inputs import Choice, Count, Covariance, Each, Fixed, Number, Numbers, Probability, Scale, Text, Thing, Wrong
from calls import Call, on
from matplotlib.figure import Figure

from trackhelpers import datasets, ledger, panels, play, plots, published, recordings, reports, tables
from trackhelpers.ledger import files, numbers, questions
from trackhelpers.published import thesis_chapter_3, thesis_chapter_4

T3, X5 = np.array([1.0, 2.0, 3.0]), np.array([10.0, 5.0, 3.0, 0.2, 0.1])
DRAWS = Numbers(np.linspace(0.0, 1.0, 50), free=True, beyond=(np.ones(39), np.ones((50, 2)), 1.0))
FRAME = pd.DataFrame({"t": [0.0, 1.0], "lat": [50.0, 50.001], "lon": [8.0, 8.001]})
CELL = questions.Question("p/n", "id", "table", "Table 1", "a", "cell", date(2026, 1, 1), printed="0.50")
CLAIM = questions.Question("p/n", "id", "claim", "1", "a", "< 1", date(2026, 1, 1))
EQUATION = questions.Question("p/n", "id", "equation", "(1)", "a", "equation", date(2026, 1, 1))
ANY = {"free": True, "gaps": True}


@cache
def axes():
    """Made once, for it takes its time; a refused call draws nothing."""
    return Figure().add_subplot()


def _on_axes(name):
    return lambda **k: getattr(plots, name)(axes(), **k)


def _printed(function, n=5, **more):
    return [Call(function, x=Numbers(X5[:n], gaps=True), dt=Scale(0.5), **more)]


def playground():
    return play.Playground(lambda rate: {"line": (T3, rate * T3)}, rate=[1.0, 2.0]).panel("x", "y", {"line": "blue -"})


NUMBER = Number(0.5)
RANGE = Numbers([1.0, 2.0], beyond=([2.0, 1.0], [1.0, 1.0]))
LIMITS = Numbers([1.0, 2.0], beyond=([2.0, 1.0], [1.0, 1.0]), optional=True)
CALLS = {
    "panels.Ellipse": [
        Call(panels.Ellipse, mean=Numbers([1.0, 2.0]), P=Covariance(np.eye(2), definite=True), probability=Probability(0.95))
    ],
    "play.Playground": [
        Call(
            lambda function: play.Playground(function, rate=[1.0]),
            function=Wrong(lambda rate: {}, 3.0, None, lambda rate: T3, lambda rate: {"a": T3}),
        ),
        Call(lambda rate: play.Playground(lambda rate: {"a": (T3, T3)}, rate=rate), rate=Numbers(T3, free=True, beyond=([], np.eye(2)))),
    ],
    "play.Playground.begin": [Call(on(playground, "begin"), label=Wrong("rate", 3, "", b"rate"), rate=NUMBER)],
    "play.Playground.panel": [
        Call(
            on(playground, "panel"),
            xlabel=Text("x"),
            ylabel=Text("y"),
            curves=Wrong({"line": "blue -"}, None, "line", {}, {"line": 3}, {"line": "blue"}, {"other": "blue -"}),
            xlim=LIMITS,
            ylim=LIMITS,
            log=Choice("x"),
            height=Scale(250.0, zero=False),
        )
    ],
    "play.Playground.html": [Call(on(playground, "html"), number=Text("1-1"), caption=Text("A line."))],
    "play.Playground.show": [Call(on(playground, "show"), number=Text("1-1"), caption=Text("A line."))],
    "play.Playground.free": [Call(on(playground, "free"), rate=RANGE)],
    "numerals.number": [Call(tables.number, value=Fixed(1.0), digits=Count(4))],
    "numerals.residual_text": [Call(tables.residual_text, value=Number(1e-12))],
    "numerals.as_printed": [Call(tables.as_printed, value=Number(0.5), text=Choice("0.50"))],
    "tables.Table": [Call(tables.Table, data=Fixed({"a": T3}), digits=Count(4), formats=Fixed({"a": 3}))],
    "tables.error_table": [
        Call(tables.error_table, errors=Numbers(np.ones((2, 3)), free=True), names=Each(Fixed("x"), Fixed("y"), optional=True)),
        Call(lambda a: tables.error_table({"a": a}), a=Numbers(T3, free=True, beyond=(np.ones((2, 2)), 1.0))),
    ],
    "tables.side_by_side": [
        Call(tables.side_by_side, paper=Thing(pd.DataFrame({"a": [1.0]})), ours=Thing(pd.DataFrame({"a": [1.0]})), digits=Fixed(None))
    ],
    "tables.matrix": [Call(tables.matrix, M=Numbers(np.eye(2), free=True, beyond=(1.0, np.ones((2, 2, 2)))), digits=Count(4))],
    "plots.truth": [Call(_on_axes("truth"), x=Numbers(T3, gaps=True), y=Numbers(T3, gaps=True))],
    "plots.measured": [Call(_on_axes("measured"), x=Numbers(T3, gaps=True), y=Numbers(T3, gaps=True), sensor=Fixed("lidar"))],
    "plots.estimate": [Call(_on_axes("estimate"), x=Numbers(T3, gaps=True), y=Numbers(T3, gaps=True), method=Count(0, least=0))],
    "plots.band": [
        Call(_on_axes("band"), t=Numbers(T3, gaps=True), low=Numbers(T3, gaps=True, number=True), high=Numbers(T3, gaps=True, number=True))
    ],
    "plots.covariance_ellipse": [
        Call(
            _on_axes("covariance_ellipse"),
            mean=Numbers([1.0, 2.0]),
            P=Covariance(np.eye(2)),
            probability=Probability(0.95),
            method=Count(0, least=0),
        )
    ],
    "plots.nees_plot": [
        Call(
            _on_axes("nees_plot"),
            t=Numbers(T3, gaps=True),
            average=Numbers(T3, gaps=True),
            limits=Each(Number(1.0, infinite=True, array=True), Number(2.0, infinite=True, array=True)),
            expected=Number(5.0, optional=True),
        )
    ],
    "plots.flow": [
        Call(
            _on_axes("flow"),
            boxes=Thing({"a": (0.0, 0.0, "A"), "b": (1.0, 0.0, "B")}),
            arrows=Each(Fixed(("a", "b")), length=False),
            fontsize=Scale(9.0, zero=False),
        )
    ],
    "plots.show": [
        Call(lambda **k: plots.show(Figure(), **{"number": "1-1", "caption": "text"} | k), number=Text("1-1"), caption=Text("text"))
    ],
    "published.tables_of": [Call(published.tables_of, paper=Choice("thesis"))],
    "published.published": [Call(published.published, paper=Choice("thesis"), table=Count(9))],
    "published.last_digit": [Call(published.last_digit, text=Choice("0.50"))],
    "published.thesis_chapter_3.transition_36": _printed(thesis_chapter_3.transition_36),
    "published.thesis_chapter_3.transition_38": _printed(thesis_chapter_3.transition_38),
    "published.thesis_chapter_3.transition_39_straight": _printed(thesis_chapter_3.transition_39_straight),
    "published.thesis_chapter_3.jacobian_310": _printed(thesis_chapter_3.jacobian_310),
    "published.thesis_chapter_3.jacobian_310_repaired": _printed(thesis_chapter_3.jacobian_310_repaired),
    "published.thesis_chapter_3.jacobian_311": _printed(thesis_chapter_3.jacobian_311),
    "published.thesis_chapter_3.noise_312": _printed(thesis_chapter_3.noise_312, mu=Numbers([1.0, 2.0], gaps=True)),
    "published.thesis_chapter_3.covariance_316": _printed(thesis_chapter_3.covariance_316, sigma_a=Scale(1.0), sigma_w=Scale(0.3)),
    "published.thesis_chapter_4.range_rate": [Call(thesis_chapter_4.range_rate, x=Numbers(X5, gaps=True))],
    "published.thesis_chapter_4.range_rate_row": [Call(thesis_chapter_4.range_rate_row, x=Numbers(X5, gaps=True), front=Choice("v"))],
    "recordings.aircraft": [Call(recordings.aircraft, name=Choice("tree"))],
    "recordings.licence": [Call(recordings.licence, file=Choice("yacht.csv"))],
    "recordings.heading_of": [
        Call(recordings.heading_of, course=Number(90.0, infinite=True, array=True)),
        Call(recordings.heading_of, course=Numbers(T3, **ANY)),
    ],
    "reports.clean": [
        Call(reports.clean, reports=Thing(FRAME), fastest=Scale(1e3, zero=False), nan=Choice("drop"), jump=Choice("keep")),
        Call(lambda lat: reports.clean(FRAME.assign(lat=lat), 1e3), lat=Fixed(FRAME["lat"])),
    ],
    "datasets.path": [Call(datasets.path, name=Choice(datasets.LIDAR_RADAR_LOG))],
    "datasets.why_not": [Call(datasets.why_not, name=Choice(datasets.LIDAR_RADAR_LOG))],
    "datasets.available": [Call(datasets.available, name=Choice(datasets.LIDAR_RADAR_LOG))],
    "ledger.answers.Ledger": [Call(ledger.Ledger, paper=Text("1_thesis"), notebook=Text("5_3_epidemic"))],
    "ledger.answers.Ledger.answer": [
        Call(on(lambda: ledger.Ledger("1_thesis", "5_3_epidemic"), "answer"), answers=Wrong({}, None, 3.0, "text", [1]))
    ],
    "ledger.files.summary": [Call(files.summary, ledger=Thing(pd.DataFrame({"notebook": ["a"], "verdict": ["reproduced"]})))],
    "ledger.files.compare": [Call(lambda **k: files.compare(".", ".", **k), rtol=Scale(1e-5), atol=Scale(1e-9))],
    "ledger.numbers.finite": [Call(lambda value: numbers.finite("id", "value", value), value=NUMBER)],
    "ledger.numbers.checked_draws": [Call(lambda draws: numbers.checked_draws("id", draws), draws=DRAWS)],
    "ledger.verdicts.Found": [Call(ledger.Found, value=Fixed(1.0), error=Text("wrong"))],
    "ledger.verdicts.verdict": [
        Call(lambda answer: ledger.verdict(CELL, answer), answer=NUMBER),
        Call(lambda answer: ledger.verdict(EQUATION, answer), answer=Scale(1e-12)),
        Call(lambda answer: ledger.verdict(CLAIM, answer), answer=Numbers(DRAWS.value, free=True, beyond=(np.ones(39), np.ones((50, 2))))),
        Call(
            lambda answer: ledger.verdict(CLAIM, tuple(answer) if isinstance(answer, list) else answer),
            answer=Each(Number(0.5, (7.0,)), Number(0.4, (0.55,)), Number(0.6), number=True),
        ),
    ],
}
