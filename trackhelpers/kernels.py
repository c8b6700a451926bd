"""A list of operations on symbols as machine code: one loop over the runs, several of them in each instruction, written down as LLVM's assembly and compiled in some 20 ms.

llvmlite, which comes with numba, is the compiler; without it, or with ``TRACKHELPERS_COMPILED=0`` in the environment, `binding` is None.
"""

import ctypes
import os
from functools import cache, lru_cache

import numpy as np

from trackhelpers.symbols import Symbol, number

try:
    if os.environ.get("TRACKHELPERS_COMPILED") == "0":
        raise ImportError
    from llvmlite import binding
except ImportError:
    binding = None

LANES = 8  # runs in one instruction, or in two of a narrower processor
TOGETHER = 64  # runs that pass many steps before the next ones start: what a step leaves to the next stays in the cache; at least LANES
_HEADER = object.__basicsize__
_COMPARED = {"<": "olt", "<=": "ole", "==": "oeq"}


class Kernel:
    """Compiled operations: arrays (…, M) in, arrays (…, M) out."""

    def __init__(self, outputs):
        """`outputs`: for each array its shape without the runs, and its symbols in the order of memory, None for a row that is not written."""
        self.shapes = [shape for shape, _ in outputs]
        places, order = {}, []
        for symbol in (each for _, symbols in outputs for each in symbols if each is not None):
            _visit(number(symbol), places, order)
        self.operations = [s.op for s in order]
        self.numbers = np.array([s.args[0] for s in order if s.op == "number"])
        code = tuple(
            (s.op, *(places[id(a)] if isinstance(a, Symbol) else a for a in s.args)) if s.op != "number" else ("number",) for s in order
        )
        stores = tuple(tuple((i, places[id(number(s))]) for i, s in enumerate(symbols) if s is not None) for _, symbols in outputs)
        self.loads = max((s.args[0] for s in order if s.op in ("load", "shared")), default=-1) + 1
        self.numbers_at = address(self.numbers)
        self._code, self._functions = (code, stores, self.loads), {}

    def __call__(self, runs, *arrays, dt=0.0, given=None):
        """The outputs for float arrays (…, runs), the inputs in the order of their numbers; `given` (k,) are numbers that all runs share, other ones at each call."""
        arrays = [np.ascontiguousarray(a, float) for a in arrays[: self.loads]]
        out = [np.empty((*shape, runs)) for shape in self.shapes]
        numbers = self.numbers if given is None else np.concatenate([self.numbers, given])
        if runs:  # the loop does its first runs before it asks whether there are any
            self.function(runs)(runs, dt, address(numbers), *map(id, out), *map(id, arrays))
        return out

    def function(self, runs):
        """`_compiled` for so many runs."""
        lanes = LANES if runs >= LANES else 1
        if lanes not in self._functions:
            self._functions[lanes] = _compiled(*self._code, lanes)
        return self._functions[lanes]


def address(array):
    """Where a NumPy array has its numbers: NumPy's C interface has the pointer to them behind what every object begins with (and `array.ctypes.data` takes a microsecond)."""
    return ctypes.c_int64.from_address(id(array) + _HEADER).value


def _visit(symbol, places, order):
    """Number a symbol and what it rests on, each once and after its own (by hand, for Python's recursion is not deep enough)."""
    stack = [symbol]
    while stack:
        top = stack[-1]
        if id(top) in places:
            stack.pop()
            continue
        waiting = [a for a in top.args if isinstance(a, Symbol) and id(a) not in places]
        if waiting:
            stack += waiting
        else:
            places[id(stack.pop())] = len(order)
            order.append(top)


@lru_cache(maxsize=512)
def _compiled(code, stores, loads, lanes):
    """The machine code of a list of operations for so many runs at a time.

    ``step(first, past, dt, numbers, table)`` does the runs from `first` to `past`; the table names each array, the results before what is read, by its address and how many
    numbers lie between its rows. ``call(M, dt, numbers, arrays…)`` writes that table for NumPy's arrays of M runs; it is returned, with the address of `step` as its attribute.
    """
    V, bits, suffix = (f"<{lanes} x double>", f"<{lanes} x i1>", f"v{lanes}f64") if lanes > 1 else ("double", "i1", "f64")
    names = [f"%n{i}" for i in range(len(code))]
    lines, numbers, calls = [], 0, set()
    own = sum(op == "number" for op, *_ in code)  # behind them are those that are given at each call

    def spread(name, source):
        """Instructions that put one number in all lanes."""
        if lanes == 1:
            names[int(name[2:])] = source
            return []
        return [
            f"{name}v = insertelement {V} undef, double {source}, i32 0",
            f"{name} = shufflevector {V} {name}v, {V} undef, <{lanes} x i32> zeroinitializer",
        ]

    for name, (op, *args) in zip(names, code, strict=True):
        given = [names[a] for a in args] if op not in ("load", "shared", "given") else args
        if op == "dt":
            lines += spread(name, "%dt")
        elif op == "number":
            lines += [f"{name}a = getelementptr double, ptr %numbers, i64 {numbers}", f"{name}s = load double, ptr {name}a"]
            lines += spread(name, f"{name}s")
            numbers += 1
        elif op == "given":
            lines += [f"{name}a = getelementptr double, ptr %numbers, i64 {own + args[0]}", f"{name}s = load double, ptr {name}a"]
            lines += spread(name, f"{name}s")
        elif op == "load":
            lines += [*_element(f"{name}a", len(stores) + args[0], args[1], "%start"), f"{name} = load {V}, ptr {name}a, align 8"]
        elif op == "shared":
            lines += [*_element(f"{name}a", len(stores) + args[0], args[1], "0"), f"{name}s = load double, ptr {name}a"]
            lines += spread(name, f"{name}s")
        elif op in _COMPARED:
            lines.append(f"{name} = fcmp {_COMPARED[op]} {V} {given[0]}, {given[1]}")
        elif op == "select":
            lines.append(f"{name} = select {bits} {given[0]}, {V} {given[1]}, {V} {given[2]}")
        elif op.startswith("llvm."):
            calls.add(op)
            lines.append(f"{name} = call {V} @{op}.{suffix}({V} {given[0]})")
        else:
            lines.append(f"{name} = {op} contract {V} {given[0]}, {given[1]}")
    for k, rows in enumerate(stores):
        for i, place in rows:
            lines += [*_element(f"%o{k}_{i}", k, i, "%start"), f"store {V} {names[place]}, ptr %o{k}_{i}, align 8"]
    arrays = range(len(stores) + loads)
    text = "\n".join(
        [
            *(f"declare {V} @{call}.{suffix}({V})" for call in sorted(calls)),
            "define void @step(i64 %first, i64 %past, double %dt, ptr noalias %numbers, ptr noalias %table) noinline {",
            "entry:",
            *(line for k in arrays for line in _entry(k)),
            f"%last = sub i64 %past, {lanes}",
            "br label %loop",
            "loop:",
            "%r = phi i64 [%first, %entry], [%next, %loop]",
            "%over = icmp sgt i64 %r, %last",
            "%start = select i1 %over, i64 %last, i64 %r",  # the last runs are done together with some that were done before
            *lines,
            f"%next = add i64 %r, {lanes}",
            "%more = icmp slt i64 %next, %past",
            "br i1 %more, label %loop, label %end",
            "end:",
            "ret void",
            "}",
            f"define void @call(i64 %M, double %dt, ptr %numbers, {', '.join(f'ptr %array{k}' for k in arrays)}) {{",
            f"%table = alloca i64, i64 {2 * len(arrays)}",
            *(line for k in arrays for line in _named(k)),
            "call void @step(i64 0, i64 %M, double %dt, ptr %numbers, ptr %table)",
            "ret void",
            "}",
        ]
    )
    engine = assembled(text)
    signature = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * (1 + len(arrays)))
    function = signature(engine.get_function_address("call"))
    function.engine, function.step = engine, engine.get_function_address("step")
    return function


def many_steps(kernels, runs, steps, table):
    """Kernels one after the other, each over its step of time, with its arrays in a table (N, arrays, 2) as for `step` in `_compiled`; some runs pass all steps before others start."""
    functions = np.array([kernel.function(runs).step for kernel in kernels])
    numbers = np.array([kernel.numbers_at for kernel in kernels])
    steps, table = np.array(steps, dtype=float), np.ascontiguousarray(table, dtype=np.int64)
    _driver()(len(kernels), runs, *map(address, (functions, steps, numbers, table)), table[0].size)


@cache
def _driver():
    engine, signature = assembled(_DRIVER), ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 4, ctypes.c_int64)
    function = signature(engine.get_function_address("run"))
    function.engine = engine
    return function


_DRIVER = f"""
define void @run(i64 %N, i64 %M, ptr %functions, ptr %steps, ptr %numbers, ptr %table, i64 %width) {{
entry:
  br label %runs
runs:
  %first = phi i64 [0, %entry], [%past, %done]
  %next = add i64 %first, {TOGETHER}
  %after = add i64 %next, {TOGETHER}
  %rest = icmp sgt i64 %after, %M
  %past = select i1 %rest, i64 %M, i64 %next
  br label %step
step:
  %k = phi i64 [0, %runs], [%k1, %step]
  %at_f = getelementptr ptr, ptr %functions, i64 %k
  %f = load ptr, ptr %at_f
  %at_dt = getelementptr double, ptr %steps, i64 %k
  %dt = load double, ptr %at_dt
  %at_n = getelementptr ptr, ptr %numbers, i64 %k
  %n = load ptr, ptr %at_n
  %row = mul i64 %k, %width
  %t = getelementptr i64, ptr %table, i64 %row
  call void %f(i64 %first, i64 %past, double %dt, ptr %n, ptr %t)
  %k1 = add i64 %k, 1
  %more = icmp slt i64 %k1, %N
  br i1 %more, label %step, label %done
done:
  %left = icmp slt i64 %past, %M
  br i1 %left, label %runs, label %end
end:
  ret void
}}
"""


def assembled(text):
    """LLVM's assembly as machine code for this processor; the engine that holds it must be kept."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )
    engine = binding.create_mcjit_compiler(binding.parse_assembly(text), machine)
    engine.finalize_object()
    return engine


def _entry(k):
    """Address and distance of rows of an array of the table."""
    at, apart = (f"getelementptr i64, ptr %table, i64 {2 * k + i}" for i in (0, 1))
    return [f"%pa{k} = {at}", f"%at{k} = load ptr, ptr %pa{k}", f"%pd{k} = {apart}", f"%apart{k} = load i64, ptr %pd{k}"]


def _named(k):
    """The entry of a NumPy array of M runs, which is found as in `address`."""
    return [
        f"%p{k} = getelementptr i8, ptr %array{k}, i64 {_HEADER}",
        f"%data{k} = load i64, ptr %p{k}",
        f"%at{k} = getelementptr i64, ptr %table, i64 {2 * k}",
        f"store i64 %data{k}, ptr %at{k}",
        f"%apart{k} = getelementptr i64, ptr %table, i64 {2 * k + 1}",
        f"store i64 %M, ptr %apart{k}",
    ]


def _element(name, array, row, start):
    return [
        f"{name}m = mul i64 %apart{array}, {row}",
        f"{name}r = add i64 {name}m, {start}",
        f"{name} = getelementptr double, ptr %at{array}, i64 {name}r",
    ]
