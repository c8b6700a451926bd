"""Valid calls of the filters of one target."""

import numpy as np
from bad_inputs import Choice, Count, Covariance, Fixed, Names, Number, Numbers, Probability, Scale, Thing, Wrong
from calls import Call, on
from filterpy.kalman import MerweScaledSigmaPoints

from trackhelpers import filters
from trackhelpers.filters import augmented_bias, factors
from trackhelpers.motion import CA, CTRV, CV
from trackhelpers.sensors import Position, Radar

QUIET, TURNING, CURVED = CV(1.0), CA(1.0), CTRV(2.0, 0.3)
F, Q, G = (getattr(QUIET, name)(np.zeros(4), 1.0) for name in "FQG")
H, R, X0, P0 = np.eye(4)[[0, 2]], np.array([[3.0, 1.0], [1.0, 2.0]]), np.array([1.0, 5.0, 2.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0])
X5, P5 = np.array([10.0, 5.0, 3.0, 0.2, 0.1]), np.diag([1.0, 2.0, 3.0, 0.4, 0.5])
POSITION, RADAR = Position(1.0, QUIET.state), Radar()
Z2, Z3 = Numbers([6.0, 7.0], optional=True), Numbers([11.0, 0.5, 3.0], optional=True)
OTHER_R2, OTHER_R3 = Covariance(R, optional=True), Covariance(np.diag([0.1, 0.01, 0.2]), optional=True)


def matrices(start=True):
    """The matrices of the filters that are given by them."""
    kinds = {"F": Numbers(F), "H": Numbers(H), "Q": Covariance(Q), "R": Covariance(R)}
    return kinds | ({"x0": Numbers(X0), "P0": Covariance(P0)} if start else {})


def two_models(x0=None):
    """The arguments of the filters with a quiet and a manoeuvring model."""
    kinds = {"quiet": Thing(QUIET), "manoeuvring": Thing(TURNING), "R": Covariance(R), "dt": Scale(1.0, zero=False)}
    return kinds | {"x0": Numbers(X0) if x0 is None else x0, "P0": Covariance(P0)}


ADAPTIVE = {
    "StrongTrackingKF": {"beta": Scale(1.0), "rho": Number(0.95, (0.0, 1.1, -1)), "factors": Choice("one")},
    "VarianceInflationKF": {"inflation": Number(100.0, (0.5, -1)), "window": Count(3), "probability": Probability(0.999)},
    "InputEstimationKF": {"G": Numbers(G, beyond=(np.ones(4), np.ones((3, 2)))), "window": Count(3), "probability": Probability(0.999)},
}
SWITCHING = {
    "VariableDimensionKF": {"window": Count(3), "enter": Probability(0.999), "leave": Probability(0.95)},
    "ManoeuvreIMM": {
        "stay": Numbers([0.98, 0.97], beyond=((1.0, 0.5), (0, 0.5))),
        "mu": Numbers([0.9, 0.1], beyond=((0.9, 0.2), (1.0, 0.0))),
    },
}
STARTED = {
    **{name: (lambda name=name, more=more: _values(name, matrices() | more)) for name, more in ADAPTIVE.items()},
    **{name: (lambda name=name, more=more: _values(name, two_models() | more)) for name, more in SWITCHING.items()},
    "MatrixKF": lambda: _values("MatrixKF", matrices()),
    "AugmentedBiasKF": lambda: _values("AugmentedBiasKF", matrices() | {"Q_bias": Covariance(Q)}),
}


def _values(name, kinds):
    return getattr(filters, name)(**{argument: kind.value for argument, kind in kinds.items()})


def _driven(make):
    """A filter some steps on, predicted and not yet updated."""

    def driven():
        kf = make()
        for k in range(1, 8):
            kf.predict()
            kf.update(None if k == 3 else [1 + 5.0 * k, 2 + 5.1 * k])
        kf.predict()
        return kf

    return driven


def _predicted(make, sensor, z):
    def predicted():
        kf = make()
        kf.predict(0.5)
        kf.update(z, sensor)
        kf.predict(0.5)
        return kf

    return predicted


def model_filters():
    """The filters on models: constructor, its own arguments, a model, a sensor."""
    spread = {"alpha": Number(1.0, (0.0,)), "beta": Number(2.0), "kappa": Number(0.0, (-5.0, -9.0))}
    return {
        "motion_kf.MotionKF": (filters.MotionKF, {}, QUIET, POSITION),
        "motion_ekf.MotionEKF": (filters.MotionEKF, {"iterations": Count(2)}, CURVED, RADAR),
        "motion_ukf.MotionUKF": (filters.MotionUKF, spread, CURVED, RADAR),
        "motion_square_root_ukf.MotionSquareRootUKF": (filters.MotionSquareRootUKF, spread | {"form": Choice("qr")}, CURVED, RADAR),
    }


def imm():
    return filters.MotionIMM(
        [filters.MotionEKF(CURVED, X5, P5), filters.MotionUKF(CTRV(9.0, 0.9), X5, P5)], [0.6, 0.4], [[0.9, 0.1], [0.2, 0.8]]
    )


def root_filter(form="qr"):
    kf = filters.SquareRootUKF(2, 2, 1.0, lambda x: x, lambda x, dt: x, MerweScaledSigmaPoints(2, 1.0, 2.0, 1.0), form=form)
    kf.P, kf.R, kf.Q = np.eye(2), np.eye(2), np.eye(2)
    kf.predict()
    return kf


def set_P(kf):
    return lambda P: setattr(kf, "P", P)


CALLS = {
    "filters.augmented_bias.augmented_matrices": [
        Call(
            augmented_bias.augmented_matrices,
            F=Numbers(F),
            H=Numbers(H, free=True, beyond=(np.eye(3),)),
            Q=Covariance(Q),
            Q_bias=Covariance(Q),
            reading=Choice("R1"),
        )
    ],
    "filters.augmented_bias.AugmentedBiasKF": [
        Call(filters.AugmentedBiasKF, **matrices(), Q_bias=Covariance(Q), reading=Choice("R1"), P_bias0=Covariance(P0, optional=True))
    ],
    "filters.factors.cholupdate": [Call(factors.cholupdate, L=Numbers(np.tril(R)), x=Numbers([0.1, 0.2]), sign=Number(1, (0, 2, 0.5)))],
    "filters.factors.lower_root": [Call(lambda P: factors.lower_root(P, "P", 2), P=Covariance(R))],
    "filters.strong_tracking.axes_seen": [
        Call(lambda factors: filters.StrongTrackingKF(F, H, Q, R, X0, P0, factors=factors), factors=Choice("per axis"))
    ],
    "filters.matrix_filter.MatrixKF": [Call(filters.MatrixKF, **matrices())],
    "filters.matrix_filter.AdaptiveKF": [Call(filters.StrongTrackingKF, **matrices())],
    "filters.strong_tracking.StrongTrackingKF": [Call(filters.StrongTrackingKF, **matrices(), **ADAPTIVE["StrongTrackingKF"])],
    "filters.variance_inflation.VarianceInflationKF": [Call(filters.VarianceInflationKF, **matrices(), **ADAPTIVE["VarianceInflationKF"])],
    "filters.input_estimation.InputEstimationKF": [Call(filters.InputEstimationKF, **matrices(), **ADAPTIVE["InputEstimationKF"])],
    "filters.variable_dimension.VariableDimensionKF": [
        Call(filters.VariableDimensionKF, **two_models(), **SWITCHING["VariableDimensionKF"])
    ],
    "filters.imm.ManoeuvreIMM": [Call(filters.ManoeuvreIMM, **two_models() | {"dt": Scale(1.0)}, **SWITCHING["ManoeuvreIMM"])],
    "filters.imm.ManoeuvreIMM.update": [Call(on(_driven(STARTED["ManoeuvreIMM"]), "update"), z=Z2, R=OTHER_R2)],
    "filters.imm.ManoeuvreIMM.predict": [Call(on(STARTED["ManoeuvreIMM"], "predict"))],
    "filters.matrix_filter.MatrixKF.update": [Call(on(_driven(make), "update"), z=Z2, R=OTHER_R2) for make in STARTED.values()],
    "filters.base.OneTarget.nees": [Call(on(STARTED["MatrixKF"], "nees"), truth=Numbers(X0))],
    **{
        f"filters.{module}.predict": [Call(on(STARTED[module.partition(".")[2]], "predict"))]
        for module in (
            "matrix_filter.MatrixKF",
            "strong_tracking.StrongTrackingKF",
            "variance_inflation.VarianceInflationKF",
            "input_estimation.InputEstimationKF",
            "variable_dimension.VariableDimensionKF",
        )
    },
    "filters.on_model.OnModel.nees": [
        Call(on(lambda: filters.MotionEKF(CURVED, X5, P5), "nees"), truth=Numbers(X5)),
        Call(lambda truth: filters.MotionEKF(CURVED, X5, P5).nees(truth, fold=True), truth=Numbers(X5)),
    ],
    "filters.motion_imm.MotionIMM": [
        Call(
            filters.MotionIMM,
            filters=Wrong(imm().filters, None, 3.0, "nonsense", [1.0, 2.0], imm().filters[:1]),
            mu0=Numbers([0.6, 0.4], beyond=([0.6, 0.6], [1.5, -0.5])),
            transition=Numbers([[0.9, 0.1], [0.2, 0.8]], beyond=([[0.9, 0.2], [0.2, 0.8]],)),
            common=Names(("x", "y"), optional=True),
        )
    ],
    "filters.motion_imm.MotionIMM.predict": [Call(on(imm, "predict"), dt=Number(0.5, (-1.0, 1e13)))],
    "filters.motion_imm.MotionIMM.update": [
        Call(on(_predicted(imm, RADAR, [11.0, 0.5, 3.0]), "update"), z=Z3, sensor=Thing(RADAR), R=OTHER_R3)
    ],
    "filters.square_root_ukf.SquareRootUKF": [
        Call(
            filters.SquareRootUKF,
            dim_x=Count(2),
            dim_z=Count(2),
            dt=Scale(1.0),
            hx=Fixed(lambda x: x),
            fx=Fixed(lambda x, dt: x),
            points=Thing(MerweScaledSigmaPoints(2, 1.0, 2.0, 1.0)),
            form=Choice("qr"),
        )
    ],
    "filters.square_root_ukf.SquareRootUKF.predict": [Call(on(root_filter, "predict"), dt=Number(0.5, (-1.0,), optional=True))],
    "filters.square_root_ukf.SquareRootUKF.update": [
        Call(on(make, "update"), z=Z2, R=Covariance(R, optional=True, number=True))
        for make in (root_filter, lambda: root_filter("cholupdate"))
    ],
    "filters.square_root_ukf.SquareRootUKF.P": [Call(lambda P: set_P(root_filter())(P), P=Covariance(R))],
}
for _name, (_make, _more, _model, _sensor) in model_filters().items():
    _x, _P, _z, _R = (X0, P0, Z2, OTHER_R2) if _model is QUIET else (X5, P5, Z3, OTHER_R3)

    def _fresh(make=_make, model=_model, x=_x, P=_P):
        return make(model, x, P)

    CALLS[f"filters.{_name}"] = [Call(_make, model=Thing(_model), x0=Numbers(_x), P0=Covariance(_P), **_more)]
    _owner = _name.replace("motion_square_root_ukf.MotionSquareRootUKF", "motion_ukf.MotionUKF")  # which inherits the two
    CALLS.setdefault(f"filters.{_owner}.predict", []).append(Call(on(_fresh, "predict"), dt=Number(0.5, (-1.0, 1e13))))
    _update = Call(on(_predicted(_fresh, _sensor, _z.value), "update"), z=_z, sensor=Thing(_sensor), R=_R)
    CALLS.setdefault(f"filters.{_owner}.update", []).append(_update)
CALLS["filters.motion_ekf.MotionEKF.update"].append(
    Call(
        on(_predicted(lambda: filters.MotionEKF(CURVED, X5, P5, iterations=3), RADAR, [11.0, 0.5, 3.0]), "update"),
        z=Z3,
        R=OTHER_R3,
        sensor=Thing(RADAR),
    )
)
