"""The contract of inputs: for every public name bad inputs are made from a valid call, each is refused by a ValueError that names argument and expectation, and changes nothing."""

import importlib
import inspect
import pkgutil
import re
import warnings
from copy import deepcopy

import calls_ensembles
import calls_filters
import calls_judging
import calls_models
import calls_pages
import calls_sensors
import numpy as np
import pytest
from inside import CALLED_BY_FILTERPY, INSIDE

import trackhelpers
from trackhelpers import datasets

TABLES = (calls_models, calls_sensors, calls_filters, calls_ensembles, calls_judging, calls_pages)
CALLS = {name: calls for table in TABLES for name, calls in table.CALLS.items()}
SETTERS = ("filters.square_root_ukf.SquareRootUKF.P",)
LEFT_OUT = ("suite", "scenarios", "forensics", "detection", "shared_compiled")  # the last two: an old name of manoeuvre; what needs numba


def public_names():
    """Public functions and classes, and the methods of these, where they are defined: ``module.name`` or ``module.Class.name``."""
    found = []
    for info in pkgutil.walk_packages(trackhelpers.__path__, "trackhelpers."):
        if set(info.name.split(".")) & set(LEFT_OUT):
            continue
        module = importlib.import_module(info.name)
        for name, value in vars(module).items():
            if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
                continue
            full = f"{info.name.removeprefix('trackhelpers.')}.{name}"
            if inspect.isfunction(value) or inspect.isclass(value):
                found += [] if name.startswith("check_") else [full]
            if inspect.isclass(value):
                methods = [each for each, method in vars(value).items() if not each.startswith("_") and inspect.isfunction(method)]
                found += [f"{full}.{each}" for each in methods if method_is_ours(vars(value)[each]) and each not in CALLED_BY_FILTERPY]
    return found


def method_is_ours(method):
    """Whether it takes arguments that somebody could get wrong; those that only refuse, as filterpy's inherited ones do, take any."""
    return not (method.__doc__ or "").startswith("Not offered")


def is_inside(name):
    parts = name.split(".")
    return name in INSIDE or any(".".join([*parts[:k], "*"]) in INSIDE for k in range(1, len(parts)))


ARGUMENTS = [
    pytest.param(call, argument, id=f"{name}-{i}-{argument}")
    for name, calls in CALLS.items()
    for i, call in enumerate(calls)
    for argument in call.arguments
]


def state(value, seen=()):
    """What a refused call must leave bit by bit as it was: arrays by their bytes, objects by their attributes, others by themselves."""
    if id(value) in seen:
        return "…"
    if isinstance(value, np.ndarray):
        return "array", value.shape, value.dtype.str, value.tobytes() if value.dtype != object else [id(each) for each in value.flat]
    if isinstance(value, (list, tuple)):
        return type(value).__name__, [state(each, (*seen, id(value))) for each in value]
    if isinstance(value, dict):
        return {key: state(each, (*seen, id(value))) for key, each in value.items() if key != "_latest"}
    if type(value).__module__.startswith("trackhelpers") and hasattr(value, "__dict__"):
        return type(value).__name__, state(value.__dict__, (*seen, id(value)))
    if isinstance(value, (int, float, complex, str, bool, type(None))):
        return repr(value)
    return id(value)


def test_every_public_name_has_a_valid_call():
    lacking = [name for name in public_names() if name not in CALLS and not is_inside(name)]
    assert not lacking


def test_every_name_that_is_registered_exists():
    names = [*public_names(), *SETTERS]
    gone = [name for name in INSIDE if not any(each == name or each.startswith(name.removesuffix("*")) for each in names)]
    assert not gone + sorted(set(CALLS) - set(names))


@pytest.mark.parametrize("name", CALLS)
def test_what_is_registered_as_valid_is_taken(name):
    if name == "datasets.path" and not datasets.available(datasets.LIDAR_RADAR_LOG):
        pytest.skip(datasets.why_not(datasets.LIDAR_RADAR_LOG))
    for call in CALLS[name]:
        _, function = call.prepared()
        function(**deepcopy_of(call.valid()))


def deepcopy_of(arguments):
    return {
        name: deepcopy(value) if isinstance(value, (np.ndarray, list)) and name != "filters" else value for name, value in arguments.items()
    }


def tells(call, argument, what, message):
    """Whether a message names the argument and what was expected; where two shapes do not fit each other it may name either."""
    shape = what.rpartition(" ")[2] in ("longer", "shorter", "wider", "flat", "empty", "axis") or what in ("('nonsense',)", "number")
    names = list(call.arguments) if shape else [argument]
    return "expected" in message and any(re.search(rf"(?<!\w){re.escape(name)}(?!\w)", message) for name in names)


def fault(call, argument, what, value):
    """What is wrong with how a bad input is received, or None."""
    owner, function = call.prepared()
    before = state(owner)
    try:
        function(**call.valid() | {argument: value})
        message = "was taken"
    except ValueError as error:
        message = None if tells(call, argument, what, str(error)) else f"is refused by {str(error)!r}"
    except Exception as error:
        message = f"is refused by {type(error).__name__}: {error}"
    if state(owner) != before:
        message = f"{message or 'is refused'}, and something was changed"
    return message and f"{argument}, {what}, {message}"


@pytest.mark.parametrize(("call", "argument"), ARGUMENTS)
def test_bad_inputs_are_refused_by_name_and_change_nothing(call, argument):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [fault(call, argument, what, value) for what, value in call.arguments[argument].bad()]
    assert [each for each in found if each] == []


def test_there_are_enough_bad_inputs():
    assert sum(1 for calls in CALLS.values() for call in calls for _ in call.bad()) >= 400


def arrays_of(value, seen=None):
    """All arrays that an object holds, whatever way."""
    seen = {} if seen is None else seen
    if id(value) in seen:
        return []
    seen[id(value)] = value
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, dict):
        return [array for each in value.values() for array in arrays_of(each, seen)]
    if isinstance(value, (list, tuple, set)):
        return [array for each in value for array in arrays_of(each, seen)]
    return (
        arrays_of(value.__dict__, seen)
        if hasattr(value, "__dict__") and not inspect.isroutine(value) and not inspect.ismodule(value)
        else []
    )


CONSTRUCTED = [name for name, calls in CALLS.items() if name.split(".")[-1][0].isupper() and not name.split(".")[-2][0].isupper()]


@pytest.mark.parametrize("name", CONSTRUCTED)
def test_what_is_made_of_the_callers_arrays_does_not_hold_them(name):
    """Or else a change of his would change a filter behind its back."""
    for call in CALLS[name]:
        given = {argument: value for argument, value in deepcopy_of(call.valid()).items() if isinstance(value, np.ndarray)}
        made = call.function(**deepcopy_of(call.valid()) | given)
        held = arrays_of(made)
        assert [argument for argument, value in given.items() if any(np.shares_memory(value, array) for array in held)] == []
