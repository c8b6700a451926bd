"""A filter's step, or a run of many steps, as one compiled loop over the runs, made of the models' and sensors' own hooks, where llvmlite (it comes with numba) is installed.

A hook is called once with `symbols` in the place of numbers; the covariance algebra is written in symbols too (`symbolic`); and the list of operations that this leaves behind is
put down as vector code and compiled (`kernels`). Numbers that occur in it (σ, R, a sensor's place) are handed over at each call, so that what differs only in these shares the
code. What cannot be traced (a sensor that moves, a hook without arithmetic) is left to NumPy. The results are NumPy's to rounding.
"""

from functools import lru_cache
from math import prod
from weakref import WeakKeyDictionary

import numpy as np

from trackhelpers import symbolic
from trackhelpers.kernels import Kernel, address, binding, many_steps
from trackhelpers.symbolic import flat, loads
from trackhelpers.symbols import Symbol, choose, number, tracing, wrap

MOST_STEPS = 16  # different ones of a model that cannot be traced for any dt at once; the further ones are left to NumPy
MOST_ITERATIONS = 10  # of an iterated EKF: the code grows with them
MOST_SENSORS = 4  # different ones in a run of many steps, each of which is compiled together with the model
_kept = WeakKeyDictionary()  # model or sensor -> what was traced of it
_kept_together = WeakKeyDictionary()  # model -> sensor -> what was traced of both


def _traced(owner, key, build, kept=_kept):
    """The kernel that `build` traces, kept with `owner`; None where it cannot be traced."""
    try:
        return kept[owner][key]
    except KeyError:
        pass
    with tracing():
        try:
            outputs = build()
        except Exception:  # whatever a hook raises that wanted a number
            outputs = None
        return kept.setdefault(owner, {}).setdefault(key, outputs and Kernel(outputs))


def _predicted(model, x, P, dt):
    """x and P after dt seconds."""
    rows, transition, noise = model._hooks(x, dt)
    difference = {(i, j): value - 1.0 if i == j else value for (i, j), value in transition.items()}
    return _normalised(model, rows), symbolic.propagated(P, difference, noise)


def _normalised(model, rows):
    rows = symbolic.Vector(wrap(number(row)) if i in model.angles else number(row) for i, row in enumerate(rows))
    for i, (low, high) in model._limits.items():
        rows[i] = choose(rows[i] < low, low, choose(rows[i] > high, high, rows[i]))
    return rows


def _corrected(sensor, model, x, P, z, R, iterations=1):
    """x, P, y, S and K after the measurement z."""
    step, P, y, S, K = symbolic.iterated(sensor._hooks, sensor.angles, x, P, z, R, iterations)
    return _normalised(model, [a + b for a, b in zip(x, step, strict=True)]), P, y, S, K


def _own_noise(sensor):
    return [[number(value) for value in row] for row in sensor.R]


def _score(truth, x, P, angles):
    """NEES."""
    return symbolic.mahalanobis([wrap(t - row) if i in angles else t - row for i, (t, row) in enumerate(zip(truth, x, strict=True))], P)


def _prediction(model, dt):
    n = model.n
    x, P = _predicted(model, loads(0, n), loads(1, n, n), dt)
    return [((n,), x), ((n, n), flat(P))]


def _update(sensor, model, own_noise, iterations):
    n, m = model.n, sensor.m
    R = _own_noise(sensor) if own_noise else loads(3, m, m)
    x, P, y, S, K = _corrected(sensor, model, loads(0, n), loads(1, n, n), loads(2, m), R, iterations)
    return [((n,), x), ((n, n), flat(P)), ((m,), y), ((m, m), flat(S)), ((n, m), flat(K))]


def _whole_step(model, sensor, dt, judged, whole, told):
    """x, P, NEES, y, S and K after a prediction and a measurement, where there is a sensor; of x, P, z and, if `judged`, a truth, "shared" by all runs or one to "load" for each.

    To store takes its time: P has only its lower half, which is what is read, unless it is to be `whole`, and y, S and K are there only if they are to be `told`.
    """
    n = model.n
    x, P = _predicted(model, loads(0, n), loads(1, n, n), dt)
    more, score = [[], [], []], []
    if sensor is not None:
        x, P, y, S, K = _corrected(sensor, model, x, P, loads(2, sensor.m), _own_noise(sensor))
        more = [y, flat(S), flat(K)] if told else more
    if judged:
        score = [_score([Symbol(judged, 3, i) for i in range(n)], x, P, model.angles)]
    P = [value if whole or j <= i else None for i, row in enumerate(P) for j, value in enumerate(row)]
    return [((), values) for values in (x, P, score, *more)]


def predict(model, x, P, dt):
    """x (n, M) and P (n, n, M) after dt seconds by the EKF's equations; None where this model cannot be traced, or there is no compiler."""
    if binding is None or not _plain(type(model), "_normalise") or not _taken(model, x, dt):
        return None
    kernel = _traced(model, "any dt", lambda: _prediction(model, Symbol("dt")))
    if kernel is None and (dt in _kept[model] or len(_kept[model]) <= MOST_STEPS):
        kernel = _traced(model, dt, lambda: _prediction(model, float(dt)))
    return kernel and kernel(x.shape[1], x, P, dt=dt)


def update(sensor, model, x, P, z, R, iterations=1):
    """x, P, y, S and K of an EKF's update; None as for `predict`, and for a sensor that changes with time or from run to run in a way that it does not tell."""
    return corrected(_update, (iterations,), sensor, model, x, P, z, R) if iterations <= MOST_ITERATIONS else None


def corrected(build, more, sensor, model, x, P, z, R):
    """What ``build(sensor, model, own_noise, *more)`` makes of an update: arrays (…, M) of x, P, z and, unless it is the sensor's own, R; None as for `update`."""
    if binding is None or not _plain(type(model), "_normalise"):
        return None
    told = timeless(sensor)
    if told is None:
        return None
    owner, key, given, signs, on_symbols = told
    own = R is sensor.R
    kernel = _traced(owner, (build, more, key, _layout(model, own)), lambda: build(on_symbols(3 if own else 4), model, own, *more))
    if kernel is None:
        return None
    runs = x.shape[1]
    noise = [] if own else [np.broadcast_to(R.reshape(*R.shape[:2], -1), (*R.shape[:2], runs))]
    return kernel(runs, x, P, z, *noise, *signs, given=given)


def timeless(sensor):
    """Of a sensor that is traced once for all times what `StationDifferences.moving` tells; None for one that changes with time or from run to run, and does not tell how."""
    if _plain(type(sensor), "at", "of_runs", "residual"):
        return sensor, (), None, (), lambda array: sensor
    moving = getattr(sensor, "moving", None)
    return moving() if moving and _plain(type(sensor), "residual") else None


def _layout(model, *more):
    """What an update's code takes from the model."""
    return model.state, model.angles, *model._limits.items(), *more


def run(model, x, P, zs, sensors, steps, truth, keep):
    """Steps of an EKF one after the other, without a return to Python: predict over steps[k], correct by zs[k] (m, M) of sensors[k], by nothing where that is None.

    The truth is (n, N, M), or (n, N, 1) for all runs, or None. Returns what is to be kept of x, P, nees, y, S and K, name -> (…, N, M), and the last (…, M) of each; None as for
    `update`, for many sensors, for y, S and K of several sizes, and for steps of several lengths where a model cannot be traced for any.
    """
    used = {id(sensor): sensor for sensor in sensors}
    sizes = {0 if sensor is None else sensor.m for sensor in used.values()}
    told = not set(keep) <= {"x", "P", "nees"}
    if binding is None or len(used) > MOST_SENSORS or (told and len(sizes) > 1) or not _plain(type(model), "_normalise"):
        return None
    if not all(sensor is None or _plain(type(sensor), "at", "of_runs", "residual") for sensor in used.values()):
        return None
    try:
        if not all(_taken(model, x, dt) for dt in set(steps)):
            return None
    except ValueError:  # to be raised at its step
        return None
    judged = None if truth is None else "shared" if truth.shape[2] == 1 else "load"
    kernels = {which: _step_of(model, sensor, steps, judged, "P" in keep, told) for which, sensor in used.items()}
    order = [*(kernels[id(sensor)] for sensor in sensors[:-1]), _step_of(model, sensors[-1], steps, judged, True, True)]
    if None in order:
        return None
    (n, runs), N, m = x.shape, len(zs), max(sizes)
    shapes = {"x": (n,), "P": (n, n), "nees": (), "y": (m,), "S": (m, m), "K": (n, m)}
    # of what is not kept there is room for two, the last one and the next
    found = {name: np.empty((*shape, N if name in keep else 2, runs)) for name, shape in shapes.items()}
    zs = [None if z is None else np.ascontiguousarray(z) for z in zs]
    x, P = (np.ascontiguousarray(start, dtype=float) for start in (x, P))
    after = {name: _places(array, N) for name, array in found.items()}
    before = [np.vstack([_places(start[..., None, :], 1), after[name][:-1]]) for name, start in (("x", x), ("P", P))]
    measured = np.array([(0 if z is None else address(z), runs) for z in zs])
    table = [*after.values(), *before, measured, *([] if truth is None else [_places(truth, N)])]
    many_steps(order, runs, steps, np.stack(table, axis=1))
    m = 0 if sensors[-1] is None else sensors[-1].m
    shapes |= {"y": (m,), "S": (m, m), "K": (n, m)}
    return {name: found[name] for name in keep}, {name: _last(found[name], N, shape) for name, shape in shapes.items()}


def _step_of(model, sensor, steps, *more):
    """The kernel of `_whole_step` for any dt or, where that cannot be traced and all steps are the same, for theirs."""
    where = (model, _kept) if sensor is None else (sensor, _kept_together.setdefault(model, WeakKeyDictionary()))
    kernel = _traced(where[0], (*more, "any dt"), lambda: _whole_step(model, sensor, Symbol("dt"), *more), where[1])
    if kernel is None and len(set(steps)) == 1:
        kernel = _traced(where[0], (*more, steps[0]), lambda: _whole_step(model, sensor, float(steps[0]), *more), where[1])
    return kernel


def _last(array, N, shape):
    """What the last of N steps left in an array (…, slots, M), its shape without the runs as given."""
    slots, runs = array.shape[-2:]
    return array.reshape(-1, slots, runs)[: prod(shape), (N - 1) % slots].reshape(*shape, runs).copy()


def _places(array, N):
    """Where an array (…, slots, M) has what belongs to each of N steps, the slots used in turn, and how many numbers lie between its rows: (N, 2)."""
    slots, runs = array.shape[-2:]
    return np.stack([address(array) + array.itemsize * runs * (np.arange(N) % slots), np.full(N, slots * runs)], axis=1)


def nees(truth, x, P, angles):
    """NEES of each run: truth (n, M) or (n, 1), x (n, M), P (n, n, M); None without a compiler."""
    n, runs = x.shape
    kernel = binding and _traced(Symbol, ("nees", n, angles), lambda: [((), [_score(loads(0, n), loads(1, n), loads(2, n, n), angles)])])
    return kernel and kernel(runs, truth if truth.shape[1] == runs else np.broadcast_to(truth, x.shape), x, P)[0]


def propagate(P, difference, noise):
    """F P Fᵀ + Q as `trackhelpers.ensemble.covariance.propagate` has it; None without a compiler."""
    n, runs = P.shape[0], P.shape[2]
    first = len(difference)
    kernel = binding and _traced(
        Symbol,
        ("propagate", n, tuple(difference), tuple(noise)),
        lambda: [((n, n), flat(symbolic.propagated(loads(0, n, n), _entries(1, difference), _entries(1, noise, first))))],
    )
    return kernel and kernel(runs, P, _stacked([*difference.values(), *noise.values()], runs))[0]


def correct(P, entries, R):
    """K, S and P as `trackhelpers.ensemble.covariance.correct` has them; None without a compiler."""
    n, runs, m = P.shape[0], P.shape[2], len(R)

    def build():
        K, S, posterior = symbolic.corrected(loads(0, n, n), _entries(1, entries), loads(2, m, m))
        return [((n, m), flat(K)), ((m, m), flat(S)), ((n, n), flat(posterior))]

    kernel = binding and _traced(Symbol, ("correct", n, m, tuple(entries)), build)
    return kernel and kernel(runs, P, _stacked(entries.values(), runs), np.broadcast_to(R, (m, m, runs)))


def mahalanobis(y, S):
    """yᵀS⁻¹y of each run, y (n, M) and S (n, n, M); None without a compiler."""
    n, runs = y.shape
    kernel = binding and _traced(Symbol, ("mahalanobis", n), lambda: [((), [symbolic.mahalanobis(loads(0, n), loads(1, n, n))])])
    return kernel and kernel(runs, y, S)[0]


def _entries(array, places, first=0):
    return {place: Symbol("load", array, first + i) for i, place in enumerate(places)}


def _stacked(values, runs):
    stacked = np.empty((len(values), runs))
    for row, value in zip(stacked, values, strict=True):
        row[:] = value
    return stacked


def _taken(model, x, dt):
    """Whether the model takes its arguments as they are; ValueError where it refuses them."""
    if _plain(type(model), "_arguments"):
        return True
    taken = model._arguments(x, dt)
    return taken[0] is x and taken[1] == dt


@lru_cache(maxsize=256)
def _plain(kind, *methods):
    """Whether a class has these methods from the package's base class: another one's would not be seen."""
    return all(getattr(kind, name) is getattr(kind.__mro__[-2], name) for name in methods)
