"""Which faults there are in a source file (cosmic-ray's operators find and make them), and which of them are taken."""

import random
import warnings
from collections import namedtuple
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.provider import OperatorProvider

# A folder of tests and the files that it answers for; a file that is split keeps its folder by the beginning of its name.
MODULES = {
    "angles": ["angles.py"],
    "arrays": ["arrays.py", "checks.py"],
    "charts": ["charts.py"],
    "consistency": ["consistency.py"],
    "ensemble": ["ensemble/*.py"],
    "exact": ["exact*.py", "by_step.py"],
    "filters": ["filters/*.py"],
    "fusion": ["fusion*.py", "tracks.py"],
    "ledger": ["ledger/*.py"],
    "manoeuvre": ["manoeuvre*.py"],
    "motion": ["motion/*.py"],
    "sensors": ["sensors/*.py"],
}

# `is` for `==` and the like changes nothing for None, small numbers and names; the other two want arguments of their own.
LEFT_OUT = ("_Eq_Is", "_NotEq_IsNot", "_Is_Eq", "_IsNot_NotEq", "VariableReplacer", "VariableInserter")
# Annotations, the text of an error and the stars of a signature are no behaviour.
NO_BEHAVIOUR = {"annassign", "tfpdef", "raise_stmt", "fstring", "parameters"}

Fault = namedtuple("Fault", "folder file line column operator occurrence")


def sources(root):
    """Pairs of folder and file below ``root/trackhelpers``, in a fixed order."""
    package = Path(root) / "trackhelpers"
    return [(folder, p.relative_to(root)) for folder, globs in MODULES.items() for g in globs for p in sorted(package.glob(g))]


def positions(code):
    """For every place (line, column) of ``code`` its faults: pairs of an operator's name and the number of its occurrence."""
    nodes = list(ast_nodes(get_ast(code)))
    signs = [node for node in nodes if node.type == "operator"]
    found = {}
    provider = OperatorProvider()
    for name in provider:
        if name.endswith(LEFT_OUT):
            continue
        operator, occurrence = provider[name](), 0
        for node in signs if name.startswith("ReplaceBinary") else nodes:
            for start, _ in operator.mutation_positions(node):
                if _behaves(node):
                    found.setdefault(start, []).append((name, occurrence))
                occurrence += 1
    return found


def _behaves(node):
    while node.parent is not None:
        above = node.parent
        if (above.type in NO_BEHAVIOUR and node.type != "param") or (above.type == "funcdef" and above.annotation is node):
            return False
        node = above
    return True


def faulty(code, fault):
    """The source with the fault in it; None where Python doesn't read it or nothing was changed."""
    changed = mutate_code(code, OperatorProvider()[fault.operator](), fault.occurrence)
    try:
        with warnings.catch_warnings(action="ignore"):
            compile(changed or "", fault.file, "exec")
    except (SyntaxError, ValueError):
        return None
    return changed if changed != code else None


def sample(root, count, seed):
    """``count`` faults, as many of a file as it has lines: a place is drawn first, then one of what can be done there."""
    draw = random.Random(seed)
    files = sources(root)
    codes = {file: (Path(root) / file).read_text(encoding="utf-8") for _, file in files}
    total = sum(code.count("\n") for code in codes.values())
    taken, due = [], 0.0
    for folder, file in files:
        due += count * codes[file].count("\n") / total
        places = sorted(positions(codes[file]).items())
        draw.shuffle(places)
        for (line, column), choices in places:
            if len(taken) >= round(due):
                break
            fault = Fault(folder, str(file), line, column, *draw.choice(choices))
            if faulty(codes[file], fault) is not None:
                taken.append(fault)
    return taken
