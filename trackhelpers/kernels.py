"""A list of operations on symbols as machine code: one loop over the runs, several of them in each instruction, written down as LLVM's assembly and compiled in some 20 ms.

llvmlite, which comes with numba, is the compiler; without it, or with ``TRACKHELPERS_COMPILED=0`` in the environment, `binding` is None.
"""

import ctypes
import os
from functools import lru_cache

import numpy as np

from trackhelpers.symbols import Symbol, number

try:
    if os.environ.get("TRACKHELPERS_COMPILED") == "0":
        raise ImportError
    from llvmlite import binding
except ImportError:
    binding = None

LANES = 8  # runs in one instruction, or in two of a narrower processor


class Kernel:
    """Compiled operations: arrays (…, M) in, arrays (…, M) out."""

    def __init__(self, outputs):
        """`outputs`: for each array its shape without the runs, and its symbols in the order of memory."""
        self.shapes = [shape for shape, _ in outputs]
        places, order = {}, []
        for _, symbols in outputs:
            for symbol in symbols:
                _visit(number(symbol), places, order)
        self.operations = [s.op for s in order]
        self.numbers = np.array([s.args[0] for s in order if s.op == "number"])
        code = tuple(
            (s.op, *(places[id(a)] if isinstance(a, Symbol) else a for a in s.args)) if s.op != "number" else ("number",) for s in order
        )
        stores = tuple(tuple(places[id(number(symbol))] for symbol in symbols) for _, symbols in outputs)
        self.loads = max((s.args[0] for s in order if s.op == "load"), default=-1) + 1
        self._numbers_at = self.numbers.ctypes.data
        self._code, self._functions = (code, stores, self.loads), {}

    def __call__(self, runs, *arrays, dt=0.0):
        """The outputs for float arrays (…, runs), the inputs in the order of their numbers."""
        lanes = LANES if runs >= LANES else 1
        if lanes not in self._functions:
            self._functions[lanes] = _compiled(*self._code, lanes)
        arrays = [np.ascontiguousarray(a) for a in arrays[: self.loads]]
        out = [np.empty((*shape, runs)) for shape in self.shapes]
        self._functions[lanes](runs, dt, self._numbers_at, *map(_address, arrays), *map(_address, out))
        return out


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


def _address(array):
    return ctypes.addressof(ctypes.c_char.from_buffer(array)) if array.flags.writeable else array.ctypes.data


@lru_cache(maxsize=512)
def _compiled(code, stores, loads, lanes):
    """The machine code of a list of operations for so many runs at a time."""
    V, bits, suffix = (f"<{lanes} x double>", f"<{lanes} x i1>", f"v{lanes}f64") if lanes > 1 else ("double", "i1", "f64")
    names = [f"%n{i}" for i in range(len(code))]
    lines, numbers, calls = [], 0, set()
    for name, (op, *args) in zip(names, code, strict=True):
        given = [names[a] for a in args] if op != "load" else args
        if op in ("number", "dt"):
            source = f"%p{name[1:]}"
            if op == "number":
                lines += [f"{source}a = getelementptr double, ptr %numbers, i64 {numbers}", f"{source} = load double, ptr {source}a"]
                numbers += 1
            else:
                source = "%dt"
            if lanes == 1:
                names[int(name[2:])] = source
            else:
                lines.append(f"{name}v = insertelement {V} undef, double {source}, i32 0")
                lines.append(f"{name} = shufflevector {V} {name}v, {V} undef, <{lanes} x i32> zeroinitializer")
        elif op == "load":
            lines += _element(f"%a{name[1:]}", f"%in{args[0]}", args[1])
            lines.append(f"{name} = load {V}, ptr %a{name[1:]}, align 8")
        elif op in ("<", "<=", "=="):
            lines.append(f"{name} = fcmp {dict(zip(('<', '<=', '=='), ('olt', 'ole', 'oeq'), strict=True))[op]} {V} {given[0]}, {given[1]}")
        elif op == "select":
            lines.append(f"{name} = select {bits} {given[0]}, {V} {given[1]}, {V} {given[2]}")
        elif op.startswith("llvm."):
            calls.add(op)
            lines.append(f"{name} = call {V} @{op}.{suffix}({V} {given[0]})")
        else:
            lines.append(f"{name} = {op} contract {V} {given[0]}, {given[1]}")
    for k, places in enumerate(stores):
        for i, place in enumerate(places):
            lines += [*_element(f"%o{k}_{i}", f"%out{k}", i), f"store {V} {names[place]}, ptr %o{k}_{i}, align 8"]
    pointers = [*(f"%in{i}" for i in range(loads)), *(f"%out{k}" for k in range(len(stores)))]
    text = "\n".join(
        [
            *(f"declare {V} @{call}.{suffix}({V})" for call in sorted(calls)),
            f"define void @step(i64 %M, double %dt, ptr %numbers, {', '.join(f'ptr noalias {p}' for p in pointers)}) {{",
            "entry:",
            f"%last = sub i64 %M, {lanes}",
            "br label %loop",
            "loop:",
            "%r = phi i64 [0, %entry], [%next, %loop]",
            "%over = icmp sgt i64 %r, %last",
            "%start = select i1 %over, i64 %last, i64 %r",  # the last runs are done together with some that were done before
            *lines,
            f"%next = add i64 %r, {lanes}",
            "%more = icmp slt i64 %next, %M",
            "br i1 %more, label %loop, label %end",
            "end:",
            "ret void",
            "}",
        ]
    )
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )
    engine = binding.create_mcjit_compiler(binding.parse_assembly(text), machine)
    engine.finalize_object()
    signature = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * (1 + len(pointers)))
    function = signature(engine.get_function_address("step"))
    function.engine = engine
    return function


def _element(name, array, row):
    return [
        f"{name}m = mul i64 %M, {row}",
        f"{name}r = add i64 {name}m, %start",
        f"{name} = getelementptr double, ptr {array}, i64 {name}r",
    ]
