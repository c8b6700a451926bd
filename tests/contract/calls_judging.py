"""Valid calls of consistency, exact recursions, fusion, intervals and the loop over measurements."""

import numpy as np
from bad_inputs import Angles, Count, Covariance, Each, Fixed, Names, Number, Numbers, Probability, Scale, Thing
from calls import Call
from calls_filters import CURVED, P0, P5, POSITION, QUIET, RADAR, X0, X5, F, H, Q, R

from trackhelpers import consistency, exact, fusion, intervals
from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.filters import MotionEKF, MotionKF
from trackhelpers.follow import follow, smooth

V2, P2 = np.array([1.0, 2.0]), np.array([[4.0, 1.0], [1.0, 3.0]])
XS, PS = np.stack([V2, V2 + 1, V2 + 2], axis=1), np.repeat(P2[..., None], 3, axis=2)
N = 3
KNOWN = exact.gains(F, H, Q, R, P0, N)
SETTLED = exact.steady_state(F, H, Q, R)
RUNS = np.arange(1.0, 9.0)
TRUTH = np.array([[1.0, 6.0, 11.0], [5.0] * 3, [2.0, 7.0, 12.0], [5.0] * 3])
SYSTEM = {"F": Numbers(F), "H": Numbers(H), "Q": Covariance(Q), "R": Covariance(R)}
TRACK, LOOSE = (
    {"x1": Numbers(V2), "P1": Covariance(P2, definite=True), "x2": Numbers(V2 + 1), "P2": Covariance(2 * P2, definite=True)},
    Covariance(P2),
)
PAIR = Each(Numbers(V2), Numbers(V2 + 1))
PAIR_P = Each(Covariance(P2, definite=True), Covariance(2 * P2, definite=True))
LEVEL = Probability(0.95)


def _followed(**arguments):
    return follow(MotionKF(QUIET, X0, P0), **arguments)


def _ensemble_followed(**arguments):
    return follow(EnsembleEKF(CURVED, np.stack([X5, X5], axis=1), P5), sensors=RADAR, dt=1.0, **arguments)


SEEN = Numbers([[11.0, 11.0], [0.5, 0.5], [3.0, 3.0]], optional=True)
HISTORY = _followed(zs=[V2, V2], sensors=POSITION, dt=1.0)
Z = Numbers([6.0, 7.0], optional=True)

CALLS = {
    "consistency.nees": [
        Call(consistency.nees, x_true=Numbers(V2), x=Numbers(V2 + 1), P=Covariance(P2, definite=True), angles=Angles((1,), 2)),
        Call(consistency.nees, x_true=Numbers(XS, gaps=True), x=Numbers(XS, gaps=True), P=Numbers(PS, gaps=True)),
    ],
    "consistency.nis": [
        Call(consistency.nis, y=Numbers(V2), S=Covariance(P2, definite=True)),
        Call(consistency.nis, y=Numbers(XS, gaps=True), S=Numbers(PS, gaps=True)),
    ],
    "consistency.chi2_band": [Call(consistency.chi2_band, dim=Count(3), runs=Count(50), level=LEVEL)],
    "consistency.cramer_rao": [
        Call(
            consistency.cramer_rao,
            Fs=Each(Numbers(F), Numbers(F)),
            Qs=Each(Covariance(Q), Covariance(Q)),
            Hs=Each(Numbers(H, optional=True), Numbers(H, optional=True)),
            Rs=Each(Covariance(R), Covariance(R)),
            P0=Covariance(P0, definite=True),
        )
    ],
    "exact.gain": [Call(exact.gain, P=Covariance(P0), H=Numbers(H), R=Covariance(R))],
    "exact.gains": [Call(exact.gains, **SYSTEM, P0=Covariance(P0), steps=Count(N, least=0))],
    "exact.errors": [
        Call(
            exact.errors,
            F=Numbers(F),
            A=Numbers(KNOWN.A),
            K=Numbers(KNOWN.K),
            R=Covariance(R),
            d=Numbers(np.zeros((4, N)), optional=True),
            Q=Covariance(Q, optional=True),
            bias0=Numbers(X0, optional=True),
            covariance0=Covariance(P0, optional=True),
        )
    ],
    "exact.exact_error": [
        Call(
            exact.exact_error,
            model=Thing(QUIET),
            sensor=Thing(POSITION),
            truth=Numbers(TRUTH, free=True, beyond=(X0, TRUTH[:3])),
            dt=Scale(1.0),
            x0=Numbers(X0),
            P0=Covariance(P0),
            error0=Covariance(P0, optional=True),
        )
    ],
    "exact.steady_state": [Call(exact.steady_state, **SYSTEM)],
    "exact.steady_errors": [
        Call(
            exact.steady_errors,
            F=Numbers(F),
            A=Numbers(SETTLED.A),
            K=Numbers(SETTLED.K),
            R=Covariance(R),
            d=Numbers(X0, optional=True),
            Q=Covariance(Q, optional=True),
        )
    ],
    "exact.alpha_beta": [
        Call(exact.alpha_beta, index=Scale(0.5, array=True)),
        Call(exact.alpha_beta, index=Numbers(V2, free=True, beyond=(-V2,))),
    ],
    "exact.steady_lag": [Call(exact.steady_lag, index=Scale(0.5, zero=False, array=True), a=Number(1.0), dt=Scale(1.0, zero=False))],
    "fusion.convex_combination": [Call(fusion.convex_combination, xs=PAIR, Ps=PAIR_P, angles=Angles((1,), 2))],
    "fusion.bar_shalom_campo": [
        Call(
            fusion.bar_shalom_campo,
            x1=Numbers(V2),
            P1=Covariance(P2),
            x2=Numbers(V2 + 1),
            P2=Covariance(2 * P2),
            P12=Numbers(0.1 * P2, beyond=(10 * P2,)),
            angles=Angles((1,), 2),
        )
    ],
    "fusion.maximum_likelihood": [
        Call(fusion.maximum_likelihood, xs=PAIR, P_joint=Covariance(np.diag([1.0, 2.0, 3.0, 4.0])), angles=Angles((1,), 2))
    ],
    "fusion.covariance_intersection": [
        Call(fusion.covariance_intersection, **TRACK, angles=Angles((1,), 2)),
        Call(
            fusion.covariance_intersection,
            x1=Numbers(XS, gaps=True),
            P1=Covariance(PS, definite=True),
            x2=Numbers(XS, gaps=True),
            P2=Covariance(PS, definite=True),
        ),
    ],
    "fusion.information_fusion": [
        Call(
            fusion.information_fusion,
            x_prior=Numbers(V2),
            P_prior=Covariance(2 * P2, definite=True),
            xs=PAIR,
            Ps=Each(Covariance(P2, definite=True), Covariance(P2, definite=True)),
            x_priors=PAIR,
            P_priors=Each(Covariance(3 * P2, definite=True), Covariance(3 * P2, definite=True)),
            angles=Angles((1,), 2),
        ),
        Call(
            lambda P_priors: fusion.information_fusion(V2, 2 * P2, [V2], [P2], [V2], P_priors),
            P_priors=Each(Numbers(3 * P2, beyond=(0.1 * P2,)), length=False),
        ),
    ],
    "fusion.cross_covariance": [
        Call(
            fusion.cross_covariance,
            P12=Numbers(P0),
            F=Numbers(F),
            Q=Covariance(Q),
            K1=Numbers(SETTLED.K),
            H1=Numbers(H),
            K2=Numbers(SETTLED.K),
            H2=Numbers(H),
        )
    ],
    "intervals.mean_interval": [
        Call(intervals.mean_interval, samples=Numbers(RUNS, free=True, truths=True, beyond=(1.0, RUNS[:1], [RUNS])), level=LEVEL)
    ],
    "intervals.ratio_interval": [
        Call(
            intervals.ratio_interval,
            numerator=Numbers(RUNS, truths=True),
            denominator=Numbers(RUNS, truths=True, beyond=(0 * RUNS,)),
            level=LEVEL,
        )
    ],
    "follow.follow": [
        Call(
            _followed,
            zs=Each(Z, Z, length=False),
            sensors=Thing(POSITION),
            dt=Scale(1.0, array=True),
            t0=Number(0.0),
            Rs=Fixed(None),
            keep=Names(("x", "P"), optional=True),
            gate=Probability(0.99, optional=True),
            truth=Numbers(TRUTH[:, :2], optional=True),
        ),
        Call(lambda dt: _followed(zs=[V2, V2], sensors=POSITION, dt=dt), dt=Each(Scale(1.0), Scale(1.0), number=True)),
        Call(
            lambda Rs: _followed(zs=[V2, V2], sensors=POSITION, dt=1.0, Rs=Rs),
            Rs=Each(Covariance(R, optional=True), Covariance(R, optional=True), optional=True),
        ),
        Call(lambda kf: follow(kf, [[11.0, 0.5, 3.0]], RADAR, 1.0), kf=Thing(MotionEKF(CURVED, X5, P5))),
        Call(_ensemble_followed, zs=Each(Numbers([[11.0, 11.0], [0.5, 0.5], [3.0, 3.0]], optional=True), length=False)),
        Call(
            lambda zs, truth: _ensemble_followed(zs=zs, truth=truth),
            zs=Each(SEEN, SEEN, length=False),
            truth=Numbers(np.ones((5, 2, 2)), optional=True),
        ),
    ],
    "smoothing.smooth": [Call(smooth, history=Thing(HISTORY))],
}
