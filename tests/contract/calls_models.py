"""Valid calls of angles, small matrices, models and charts."""

import numpy as np
from bad_inputs import Angles, Choice, Count, Covariance, Each, Fixed, Names, Number, Numbers, Probability, Scale, Thing
from calls import Call, on

from trackhelpers import angles, arrays, charts, manoeuvre
from trackhelpers.model import Model
from trackhelpers.motion import CA, CCA, CSAA, CSAV, CTRA, CTRV, CV, LinearModel, PolarCA, PolarCV, Singer, arc

V2, V3, V5 = np.array([1.0, 2.0]), np.array([1.0, 2.0, 3.0]), np.array([10.0, 5.0, 3.0, 0.2, 0.1])
P2, P5 = np.array([[4.0, 1.0], [1.0, 3.0]]), np.diag([1.0, 2.0, 3.0, 0.4, 0.5])
MANY = np.stack([V2, V2 + 1, V2 + 2], axis=1)
DT = Number(0.5, (-1.0, -1e-12, 1e13, 1e300))
OTHER_SHAPE = (np.ones((2, 5)), np.ones(5))
SHAPED = {"gaps": True, "free": True, "beyond": (np.ones((5, 7)), V2)}


class Plain(Model):
    """A model of a count, with bounds."""

    state, bounds = ("n",), {"n": (0.0, 10.0)}

    def _f(self, x, dt, parts):
        return [x[0] * (1 + 0.1 * dt)]

    def _G(self, x, dt, parts):
        return {(0, 0): dt}


def noise():
    return Choice("exact")


def sigmas(*names, kind=Scale):
    return {name: kind(0.3) for name in names}


def _motion(kind, Q_size, *names, **more):
    return [Call(kind, noise=noise(), Q=Covariance(np.eye(Q_size), optional=True), **sigmas(*names), **more)]


EITHER = Number(0.3, infinite=True, array=True)
MODEL = CTRV(2.0, 0.3)
X = Numbers(V5, beyond=(np.ones((4, 3)),))

CALLS = {
    "angles.wrap": [
        Call(angles.wrap, angle=Numbers(V2, free=True, gaps=True)),
        Call(angles.wrap, angle=Number(7.0, infinite=True, array=True)),
    ],
    "angles.wrap_components": [Call(angles.wrap_components, x=Numbers(MANY, free=True, gaps=True), angles=Angles((1,), 2))],
    "angles.residual": [
        Call(angles.residual, a=Numbers(V2, gaps=True, number=True), b=Numbers(V2, gaps=True, number=True), angles=Angles((1,), 2)),
        Call(
            angles.residual,
            a=Numbers(MANY, gaps=True, number=True, beyond=OTHER_SHAPE),
            b=Numbers(MANY, gaps=True, number=True, beyond=OTHER_SHAPE),
        ),
    ],
    "angles.mean": [
        Call(
            angles.mean,
            points=Numbers(MANY, gaps=True, free=True, beyond=(V3, MANY[:, :2])),
            weights=Numbers([0.2, 0.3, 0.5], gaps=True),
            angles=Angles((0,), 2),
        ),
    ],
    "arrays.matmul": [Call(arrays.matmul, A=Numbers(np.eye(2, 3), **SHAPED), B=Numbers(np.eye(3), **SHAPED))],
    "arrays.matvec": [Call(arrays.matvec, A=Numbers(np.eye(2, 3), **SHAPED), x=Numbers(V3, gaps=True))],
    "arrays.transpose": [Call(arrays.transpose, A=Numbers(np.eye(2, 3), gaps=True, free=True))],
    "arrays.congruence": [Call(arrays.congruence, A=Numbers(np.eye(2, 3), **SHAPED), P=Numbers(np.eye(3), gaps=True))],
    "arrays.symmetrised": [Call(arrays.symmetrised, P=Numbers(P2, gaps=True))],
    "arrays.cholesky": [Call(arrays.cholesky, P=Numbers(P2, gaps=True))],
    "arrays.solve_lower": [
        Call(arrays.solve_lower, L=Numbers(np.tril(P2), gaps=True), B=Numbers(P2, gaps=True, free=True, beyond=(V3, 1.0, np.eye(3))))
    ],
    "arrays.inverse": [Call(arrays.inverse, P=Numbers(P2, gaps=True))],
    "arrays.divide": [Call(arrays.divide, A=Numbers(np.eye(2), free=True, beyond=(np.eye(3), V2)), P=Numbers(P2, beyond=(-P2,)))],
    "arrays.eliminate": [
        Call(arrays.eliminate, S=Numbers(P2, gaps=True), below=Numbers(np.eye(1, 2), gaps=True, free=True, beyond=(np.ones((1, 3)),)))
    ],
    "arrays.mahalanobis": [Call(arrays.mahalanobis, y=Numbers(V2, gaps=True), S=Numbers(P2, gaps=True))],
    "model.Model": [
        Call(Plain, sigmas=Fixed([("s", 1.0)]), Q=Covariance([[2.0]], optional=True)),
        Call(lambda s: Plain([("s", s)]), s=Scale(1.0)),
    ],
    **{f"model.Model.{name}": [Call(on(lambda: MODEL, name), x=X, dt=DT)] for name in ("f", "F", "G", "Q", "step", "linearised")},
    "model.Model.normalise": [Call(on(lambda: MODEL, "normalise"), x=X)],
    "motion.base.MotionModel": [Call(lambda **k: CTRV(1.0, 1.0, **k), noise=noise(), Q=Covariance(np.eye(5), optional=True))],
    "motion.base.MotionModel.fold": [Call(on(lambda: MODEL, "fold"), x=Numbers(V5), near=Numbers(V5, optional=True))],
    "motion.base.LinearMotion": [Call(lambda **k: CV(1.0, **k), noise=noise(), Q=Covariance(np.eye(4), optional=True))],
    "motion.straight.Cartesian": [Call(CV, sigma_a=Each(Scale(1.0), Scale(2.0), number=True), axes=Count(2))],
    "motion.straight.CV": _motion(CV, 4, axes=Count(2), sigma_a=Scale(1.0, array=True)),
    "motion.straight.CA": _motion(CA, 6, axes=Count(2), sigma_da=Scale(1.0, array=True)),
    "motion.straight.PolarCV": _motion(PolarCV, 4, "sigma_a", "sigma_w"),
    "motion.straight.PolarCA": _motion(PolarCA, 5, "sigma_j", "sigma_w"),
    "motion.turn.CTRV": _motion(CTRV, 5, "sigma_a", "sigma_w"),
    "motion.turn.CTRA": _motion(CTRA, 6, "sigma_j", "sigma_w"),
    "motion.curvature.CSAV": _motion(CSAV, 5, "sigma_a", "sigma_phi", wheelbase=Scale(2.0, zero=False)),
    "motion.curvature.CSAA": _motion(CSAA, 6, "sigma_j", "sigma_phi", wheelbase=Scale(2.0, zero=False)),
    "motion.curvature.CCA": _motion(CCA, 6, "sigma_j", "sigma_c"),
    "motion.singer.Singer": [
        Call(Singer, sigma_m=Scale(1.0, array=True), tau=Scale(20.0, zero=False), axes=Count(2), Q=Covariance(np.eye(6), optional=True)),
        Call(Singer, sigma_m=Each(Scale(1.0), Scale(2.0), number=True)),
    ],
    "motion.given.LinearModel": [
        Call(
            LinearModel,
            F=Numbers(np.eye(2)),
            Q=Covariance(P2),
            dt=Scale(0.5, zero=False),
            state=Names(("x", "θ"), beyond=((1, 2),)),
            angles=Angles((1,), 2),
        )
    ],
    "motion.arc.turn_integrals": [
        Call(arc.turn_integrals, phi=Numbers(V2, free=True, gaps=True), order=Choice(2)),
        Call(arc.turn_integrals, phi=Number(0.3, infinite=True, array=True), order=Count(2, least=0)),
    ],
    "charts.ecef": [
        Call(charts.ecef, lat=EITHER, lon=EITHER, h=EITHER),
        Call(charts.ecef, lat=Numbers(V2, gaps=True, free=True, beyond=(V3,)), lon=Numbers(V2, gaps=True, free=True), h=EITHER),
    ],
    "charts.geodetic": [Call(charts.geodetic, position=Numbers([6.4e6, 0.0, 1e5]))],
    "charts.next_sign": [
        Call(charts.next_sign, z=EITHER, z_rate=EITHER, dt=DT),
        Call(charts.next_sign, z=Numbers(V2, gaps=True, free=True, beyond=(V3,)), z_rate=Numbers(V2, gaps=True, free=True), dt=DT),
    ],
    "charts.Ellipsoid": [
        Call(charts.Ellipsoid, sign=Number(1, (0, 2, 0.5), array=True)),
        Call(charts.Ellipsoid, sign=Numbers([1, -1], free=True)),
    ],
    "charts.Ellipsoid.with_sign": [Call(on(charts.Ellipsoid, "with_sign"), sign=Number(-1, (0, 2, 0.5), array=True))],
    "charts.LocalENU": [Call(charts.LocalENU, lat=Number(0.5, (1.6, 45)), lon=Number(2.0, (7.0,)), h=Number(0.0))],
}
for _name, _chart in (
    ("Plane", charts.Plane),
    ("Ellipsoid", charts.Ellipsoid),
    ("LocalENU", lambda: charts.LocalENU(0.5, 2.0)),
):
    _q, _p = (
        (np.array([2e6, 3e6]), np.array([2e6, 3e6, 5.2e6]))
        if _name == "Ellipsoid"
        else (np.array([2e3, 3e3]), np.array([-2.3e6, 5.1e6, 3.1e6]))
    )
    CALLS |= {f"charts.{_name}.{method}": [Call(on(_chart, method), q=Numbers(_q))] for method in ("position", "jacobian")}
    CALLS[f"charts.{_name}.to_chart"] = [Call(on(_chart, "to_chart"), position=Numbers(_p))]
CALLS["charts.Chart.velocity"] = [Call(on(charts.Plane, "velocity"), q=Numbers(V2), rate=Numbers(V2))]

_NIS = EITHER
CALLS |= {
    "manoeuvre.fading_limit": [Call(manoeuvre.fading_limit, dim=Count(2), window=Count(5), probability=Probability(0.999))],
    "manoeuvre.fading_sum": [
        Call(manoeuvre.fading_sum, total=_NIS, nis=_NIS, window=Count(5)),
        Call(
            manoeuvre.fading_sum,
            total=Numbers(V2, gaps=True, free=True, beyond=(V3,)),
            nis=Numbers(V2, gaps=True, free=True),
            window=Count(5),
        ),
    ],
    "manoeuvre.position_rows": [Call(manoeuvre.position_rows, model=Thing(CV(1.0)))],
    "manoeuvre.constant_input": [
        Call(
            manoeuvre.constant_input,
            y=Each(Numbers(V2), Numbers(V2)),
            S=Each(Numbers(P2, gaps=True), Numbers(P2, gaps=True)),
            K=Each(Numbers(np.eye(4, 2), gaps=True), Numbers(np.eye(4, 2), gaps=True)),
            steps=Each(Count(1), Count(1)),
            F=Numbers(CV(1.0).F(np.zeros(4), 1.0)),
            G=Numbers(CV(1.0).G(np.zeros(4), 1.0), free=True, beyond=(np.ones(4),)),
            H=Numbers(np.eye(4)[[0, 2]]),
        )
    ],
    "manoeuvre.manoeuvre_start": [
        Call(
            manoeuvre.manoeuvre_start,
            x=Numbers([1.0, 2.0, 3.0, 4.0]),
            P=Covariance(np.diag([1.0, 2.0, 3.0, 4.0])),
            z=Numbers(V2),
            R=Covariance(P2),
            dt=Scale(1.0, zero=False),
        )
    ],
}
