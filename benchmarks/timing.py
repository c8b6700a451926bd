"""Costs that may be divided by each other: everyone takes a turn in every round, so a machine that slows down slows down all of them."""

import gc
from time import perf_counter

import numpy as np

LEAST = 0.02  # s: what is shorter is repeated until it is not


def interleaved(contenders, rounds):
    """Seconds a call of each contender: dict name -> array (rounds,), from rounds A B C A B C …

    `contenders`: dict name -> function without arguments. Each is called once before, to warm up and to find how often to repeat it.
    """
    repeats = {name: max(1, round(LEAST / _seconds(call, 1))) for name, call in contenders.items()}
    costs = {name: np.empty(rounds) for name in contenders}
    gc.collect()
    for turn in range(rounds):
        for name, call in contenders.items():
            costs[name][turn] = _seconds(call, repeats[name])
    return costs


def _seconds(call, repeats):
    gc.disable()  # as timeit does
    try:
        begin = perf_counter()
        for _ in range(repeats):
            call()
        return (perf_counter() - begin) / repeats
    finally:
        gc.enable()
