"""Valid calls of the ensembles: runs on the last axis."""

import numpy as np
from bad_inputs import Count, Covariance, Each, Fixed, Mask, Number, Numbers, Scale, Thing, Wrong
from calls import Call, on
from calls_filters import ADAPTIVE, CURVED, P0, P5, POSITION, QUIET, RADAR, SWITCHING, X0, X5, R, matrices, model_filters, two_models

from trackhelpers import ensemble
from trackhelpers.ensemble import adaptive, many_matrix_filters, motion_imm, switching

M = 4
SHIFTS = np.arange(M) * 0.1
XS4, XS5 = X0[:, None] + SHIFTS, X5[:, None] + SHIFTS
ZS2, ZS3 = np.array([[6.0], [7.0]]) + SHIFTS, np.array([[11.0], [0.5], [3.0]]) + 0.1 * SHIFTS
STARTS = Numbers(XS4, free=True, beyond=(X0, XS4[1:], XS4[:, :0]))
MASK = Mask([True, False, True, True], optional=True)
EACH_R = Covariance(np.repeat(R[..., None], M, axis=2), optional=True)


def _ensembles():
    spread = model_filters()["motion_ukf.MotionUKF"][1]
    return {
        "linear.EnsembleKF": (ensemble.EnsembleKF, {}, QUIET, POSITION),
        "filters.EnsembleEKF": (ensemble.EnsembleEKF, {"iterations": Count(2)}, CURVED, RADAR),
        "filters.EnsembleUKF": (ensemble.EnsembleUKF, spread, CURVED, RADAR),
    }


def _predicted(make):
    def predicted():
        ens = make()
        ens.predict(0.5)
        return ens

    return predicted


def _driven(make):
    def driven():
        ens = make()
        for k in range(1, 6):
            ens.predict()
            ens.update(ZS2 + 5.0 * (k - 1), mask=np.arange(M) != k % M)
        ens.predict()
        return ens

    return driven


def _on_matrices():
    """Constructor and arguments of the ensembles on matrices."""
    runs = {"x0": STARTS}
    found = {
        f"adaptive.Ensemble{name}": (getattr(adaptive, f"Ensemble{name}"), matrices() | runs | more) for name, more in ADAPTIVE.items()
    }
    found["many_matrix_filters.EnsembleMatrixKF"] = many_matrix_filters.EnsembleMatrixKF, matrices() | runs
    for name, more in SWITCHING.items():
        kind = "EnsembleIMM" if name == "ManoeuvreIMM" else f"Ensemble{name}"
        found[f"switching.{kind}"] = (
            getattr(switching, kind),
            two_models(STARTS) | more | ({"dt": Scale(1.0)} if kind == "EnsembleIMM" else {}),
        )
    return found


def _task(rngs):
    return {"sum": np.zeros(2)}


def _generators():
    return [np.random.default_rng(i) for i in range(2)]


CALLS = {
    "ensemble.montecarlo.standard_normal": [
        Call(ensemble.standard_normal, rngs=Fixed(_generators()), shape=Each(Count(2, least=0), Count(3, least=0), length=False))
    ],
    "ensemble.montecarlo.monte_carlo": [
        Call(
            ensemble.monte_carlo,
            task=Thing(_task),
            runs=Count(2),
            seed=Count(0, least=0, large=True),
            n_jobs=Fixed(1),
            chunk=Count(2),
        )
    ],
}
_updates = []
for _name, (_make, _more, _model, _sensor) in _ensembles().items():
    _x, _P, _z = (XS4, P0, ZS2) if _model is QUIET else (XS5, P5, ZS3)

    def _fresh(make=_make, model=_model, x=_x, P=_P):
        return make(model, x, P)

    CALLS[f"ensemble.{_name}"] = [
        Call(_make, model=Thing(_model), x0=Numbers(_x, free=True, beyond=(_x[:, 0], _x[1:], _x[:, :0])), P0=Covariance(_P), **_more),
        Call(lambda P0, make=_make, model=_model, x=_x: make(model, x, P0), P0=Covariance(np.repeat(_P[..., None], M, axis=2))),
    ]
    CALLS[f"ensemble.{_name}.predict"] = [Call(on(_fresh, "predict"), dt=Number(0.5, (-1.0, 1e13)))]
    _each = Covariance(np.repeat(_sensor.R[..., None], M, axis=2), optional=True)
    _some = Mask(MASK.value, optional=True)
    _updates += [Call(on(_predicted(_fresh), "update"), z=Numbers(_z, optional=True), sensor=Thing(_sensor), mask=_some, R=_each)]
    CALLS.setdefault("ensemble.base.Ensemble.nees", []).append(Call(on(_fresh, "nees"), truth=Numbers(_x[:, 0])))


def imm():
    return motion_imm.EnsembleMotionIMM([ensemble.EnsembleEKF(CURVED, XS5, P5), ensemble.EnsembleUKF(CURVED, XS5, P5)], [0.6, 0.4], CHAIN)


CHAIN = [[0.9, 0.1], [0.2, 0.8]]
CALLS |= {
    "ensemble.motion_imm.EnsembleMotionIMM": [
        Call(
            motion_imm.EnsembleMotionIMM,
            filters=Wrong(imm().filters, None, 3.0, "nonsense", [1.0, 2.0], imm().filters[:1]),
            mu0=Numbers([0.6, 0.4], beyond=([0.6, 0.6], [1.5, -0.5])),
            transition=Numbers(CHAIN, beyond=([[0.9, 0.2], [0.2, 0.8]],)),
        )
    ],
    "ensemble.motion_imm.EnsembleMotionIMM.predict": [Call(on(imm, "predict"), dt=Number(0.5, (-1.0, 1e13)))],
    "ensemble.motion_imm.EnsembleMotionIMM.update": [
        Call(
            on(_predicted(imm), "update"),
            z=Numbers(ZS3, optional=True),
            sensor=Thing(RADAR),
            mask=MASK,
            R=Covariance(np.repeat(RADAR.R[..., None], M, axis=2), optional=True),
        )
    ],
}
CALLS["ensemble.base.Ensemble.update"] = _updates
CALLS["ensemble.base.Ensemble"] = CALLS["ensemble.filters.EnsembleEKF"]
for _name, (_make, _kinds) in _on_matrices().items():
    CALLS[f"ensemble.{_name}"] = [Call(_make, **_kinds)]

    def _fresh(make=_make, kinds=_kinds):
        return make(**{name: kind.value for name, kind in kinds.items()})

    CALLS[f"ensemble.{_name}.predict"] = [Call(on(_fresh, "predict"))]
    CALLS.setdefault("ensemble.many_matrix_filters.MatrixEnsemble.update", []).append(
        Call(on(_driven(_fresh), "update"), z=Numbers(ZS2, optional=True), R=EACH_R, mask=MASK)
    )
    CALLS.setdefault("ensemble.many_matrix_filters.MatrixEnsemble.nees", []).append(Call(on(_fresh, "nees"), truth=Numbers(X0)))
