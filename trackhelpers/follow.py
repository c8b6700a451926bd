"""The loop that everybody writes: predict, take the sensor's measurement, correct, keep what it gave."""

from functools import lru_cache
from inspect import signature

import numpy as np
from scipy.stats import chi2

from trackhelpers.arrays import check_dt
from trackhelpers.checks import check_matrix, check_names, check_number, check_numbers, check_probability
from trackhelpers.smoothing import Step
from trackhelpers.smoothing import smooth as smooth


class History:
    """What `follow` kept; index k is after zs[k], and time lies between the components and the runs.

    Attributes
    ----------
    filter : the filter, as the last step left it
    t : numpy.ndarray, shape (N,)
        Time after each step, s.
    x (n, N[, M]), P (n, n, N[, M]) : the filter's `estimate` and `estimate_P`
    y (m, N[, M]), S (m, m, N[, M]) : innovations and their covariances, m the largest measurement; NaN where there is nothing
        Each of them, and any other attribute that was asked for, only where it was kept.
    nees : (N,) or (N, M)
        Normalised estimation error squared, where the truth was given.
    outliers : tuple of int
        The measurements that the gate kept out.
    """

    def __init__(self, filter, t, kept, steps, outliers=()):
        self.filter, self.t, self._steps, self.outliers = filter, t, steps, outliers
        for name, value in kept.items():
            setattr(self, name, value)
        self._kept = tuple(kept)

    def __repr__(self):
        shapes = ", ".join(f"{name} {getattr(self, name).shape}" for name in self._kept)
        return f"History({type(self.filter).__name__}, {len(self.t)} steps: {shapes})"


def follow(kf, zs, sensors=None, dt=None, t0=0.0, Rs=None, masks=None, keep=None, gate=None, truth=None):
    """Run a filter of one target, or an ensemble, over a sequence of measurements.

    For each k: predict over dt[k], take the sensor as it is at t0 + dt[0] + … + dt[k] (`Sensor.at`), correct by zs[k]. An `EnsembleEKF` without
    masks and `Rs` does all of it in one compiled loop, where `trackhelpers.fused` can trace its model and sensors.

    Parameters
    ----------
    kf : a filter of `trackhelpers.filters` or an ensemble of `trackhelpers.ensemble`
        It is moved on, and ends where the last measurement leaves it.
    zs : sequence of N measurements
        Each (m,), for an ensemble (m, M) or (m, 1), or None: a missed scan.
    sensors : Sensor or sequence of N, optional
        One for all, or one a measurement (None where that is missed). Left out for filters on matrices, which have theirs.
    dt : float or sequence of N, optional
        Step before each measurement, s, ≥ 0: 0 for a second sensor at the same instant. Left out for filters on matrices.
    t0 : float
        Time at the start, s.
    Rs : array_like (m, m) or sequence of N, optional
        Noise covariances in the place of the sensor's; None in a sequence keeps the sensor's own.
    masks : sequence of N, optional
        For an ensemble: booleans (M,), the runs that are measured, or None for all.
    keep : sequence of str, optional
        What to keep: "x", "P", "y", "S", or any attribute of the filter (K, mu, …). By default x, P, y and S; of an ensemble x alone, which is large enough.
    gate : float, optional
        Of one target's filter: a measurement whose NIS exceeds the chi-square quantile of this probability is an outlier, and taken as missed; of a bank of filters, the
        smallest of their NIS. Bar-Shalom, Li and Kirubarajan (2001), section 2.4.2 for the test.
    truth : array_like, shape (n, N), for an ensemble also (n, N, M), optional
        The true state after each step; then the history has `nees`, (N,) or (N, M), too.

    Returns
    -------
    History

    Raises
    ------
    ValueError
        Sequences of another length than zs, a gate that is no probability, or a truth of another shape or not finite, before anything is moved; what predict and update raise,
        with the index of the measurement, at which the filter then stands.
    """
    if not hasattr(kf, "predict") or not hasattr(kf, "update"):
        raise ValueError(f"kf: expected a filter or an ensemble, got {kf!r}")
    if not isinstance(zs, (list, tuple, np.ndarray)):
        raise ValueError(f"zs: expected a sequence of measurements, got {zs!r}")
    zs, t0 = list(zs), check_number(t0, "t0", "a finite time, seconds as a number")
    sensors, steps, Rs, masks = (_each(value, name, zs) for value, name in ((sensors, "sensors"), (dt, "dt"), (Rs, "Rs"), (masks, "masks")))
    if steps is None and any(each.default is each.empty for each in signature(kf.predict).parameters.values()):
        raise ValueError(f"dt: expected the step before each measurement, s, which {type(kf).__name__}.predict takes, got None")
    steps = None if steps is None else [check_dt(step, "dt") for step in steps]
    t = t0 + (np.arange(1, len(zs) + 1) if steps is None else np.cumsum(steps))
    many = hasattr(kf, "runs")
    if gate is not None and many:
        raise ValueError(f"gate: expected a filter of one target, got {type(kf).__name__}")
    gate = None if gate is None else check_probability(gate, "gate")
    keep = (("x",) if many else ("x", "P", "y", "S")) if keep is None else check_names(keep, "keep", empty=True)
    lacking = [name for name in keep if not hasattr(kf, name)]
    if lacking:
        raise ValueError(f"keep: expected attributes of {type(kf).__name__}, got {lacking}")
    truth = None if truth is None else _truth(truth, kf, len(zs), many)
    found = _at_once(kf, zs, sensors, steps, Rs, masks, keep, truth) if many and np.isfinite(t).all() else None
    if found is not None:
        return History(kf, t, found, None)
    kept, smoothable = {name: [] for name in (*keep, *(() if truth is None else ("nees",)))}, getattr(kf, "smoothable", False)
    passed, outliers = [], []
    for k, z in enumerate(zs):
        P_before = kf.P
        try:
            kf.predict(*(() if steps is None else (steps[k],)))
            if smoothable:
                cross = kf.cross if hasattr(kf, "cross") else P_before @ kf.F.T
                prior = kf.x.copy(), kf.P.copy(), cross
            arguments = _arguments(k, t[k], sensors, Rs, masks)
            if gate is None or z is None:
                kf.update(z, **arguments)
            elif not _update_within(kf, z, gate, arguments):
                outliers.append(k)
        except ValueError as error:
            raise ValueError(f"zs[{k}]: {_of_step(str(error), k)}") from error
        if smoothable:
            passed.append(Step(*prior, kf.x.copy(), kf.P.copy()))
        for name in keep:
            kept[name].append(np.array(getattr(kf, {"x": "estimate", "P": "estimate_P"}.get(name, name)), dtype=float))
        if truth is not None:
            kept["nees"].append(np.array(kf.nees(truth[:, k])))
    return History(kf, t, {name: _stacked(values, many) for name, values in kept.items()}, passed if smoothable else None, tuple(outliers))


def _truth(truth, kf, N, many):
    """(n, N) or, for an ensemble, (n, N, M)."""
    truth = check_numbers(truth, "truth")
    return check_matrix(truth, "truth", (len(kf.estimate), N, *((kf.runs,) if many and truth.ndim == 3 else ())))


def _at_once(kf, zs, sensors, steps, Rs, masks, keep, truth):
    """What is kept of an ensemble, (…, N, M), moved on in one compiled loop; None where it has to go step by step."""
    plain = sensors is not None and steps is not None and Rs is None and (masks is None or all(mask is None for mask in masks))
    if not plain or len(zs) < 2 or not set(keep) <= {"x", "P", "y", "S", "K"} or not hasattr(kf, "_run"):
        return None
    if truth is None:
        return kf._run(zs, sensors, steps, None, keep)
    return kf._run(zs, sensors, steps, np.ascontiguousarray(truth if truth.ndim == 3 else truth[..., None]), (*keep, "nees"))


def _update_within(kf, z, gate, arguments):
    """Correct by z unless its NIS lies beyond the gate; then the filter stands where a missed scan leaves it. Return whether it was taken."""
    bank = getattr(kf, "filters", ())
    before = [(each, each.__dict__.copy()) for each in (kf, *bank)]  # updates put new arrays in the place of old ones
    kf.update(z, **arguments)
    if min(each.mahalanobis**2 for each in bank or (kf,)) <= _quantile(gate, len(z)):
        return True
    for each, attributes in before:
        each.__dict__.clear()
        each.__dict__.update(attributes)
    kf.update(None, **arguments)
    return False


@lru_cache
def _quantile(probability, m):
    """Of chi-square with m degrees of freedom; SciPy takes longer for it than a filter for its step."""
    return chi2.ppf(probability, m)


def _of_step(message, k):
    """What a filter says of its argument, in the name of the sequence that it comes from."""
    name, colon, rest = message.partition(":")
    return f"{name}s[{k}]{colon}{rest}" if name in ("R", "sensor", "mask") else message


def _arguments(k, t, sensors, Rs, masks):
    found = {}
    if sensors is not None:
        found["sensor"] = None if sensors[k] is None else sensors[k].at(t)
    if Rs is not None and Rs[k] is not None:
        found["R"] = Rs[k]
    if masks is not None:
        found["mask"] = masks[k]
    return found


def _each(value, name, zs):
    """`value` as a list, one for each measurement; None stays None."""
    if value is None:
        return None
    if name == "sensors":
        one = hasattr(value, "at")
        if not one and not (isinstance(value, (list, tuple)) and all(each is None or hasattr(each, "at") for each in value)):
            raise ValueError(f"sensors: expected a sensor, or a sequence of one a measurement, got {value!r}")
    else:
        one = np.ndim(value) == (2 if name == "Rs" else 0) if not isinstance(value, (list, tuple)) else False
    values = [value] * len(zs) if one or not hasattr(value, "__len__") else list(value)
    if len(values) != len(zs):
        raise ValueError(f"{name}: expected one for all or {len(zs)}, one a measurement, got {len(values)}")
    return values


def _stacked(values, many):
    """One array with time behind the components, (…, N) or (…, N, M), shorter values padded with NaN."""
    axes = values[0].ndim - (1 if many else 0) if values else 0
    if len({value.shape for value in values}) == 1:
        return np.stack(values, axis=axes)
    largest = [max((value.shape[i] for value in values), default=0) for i in range(axes)]
    padded = []
    for value in values:
        whole = np.full((*largest, *value.shape[axes:]), np.nan)
        whole[tuple(slice(size) for size in value.shape[:axes])] = value
        padded.append(whole)
    return np.stack(padded, axis=axes) if padded else np.zeros((0, 0))
