"""What a public name's docstring has to say, worked out from its signature and its body: the rules of test_docstrings.py.

* A number says its unit, its range or what it counts; an array its shape and its type; both where they go in and where they come out.
  Saying ``as of `name` `` hands this on to a public name that says it.
* What can raise says so: each error that its own body raises by name; ``Errors as of `name` `` or another error where only what it
  calls raises.
"""

import ast
import inspect
import re
import textwrap
from pathlib import Path

# Parameters that are arrays, or hold them, though their annotation is `Any`.
ARRAYS = {"rgb", "depth", "poses", "ids", "bodies", "motion", "pictures", "out", "place", "corners", "first", "second"}
# Results that are arrays though their annotation is `Any`.
GIVES_ARRAYS = {"shutterbug.Camera.__call__", "shutterbug.Frame.result", "shutterbug.Frame.read", "shutterbug.Frame.radiance"}
UNITS = {
    "_rad_s": r"rad/s", "_m_s": r"m/s", "_ms": r"\bms\b", "_hz": r"\bHz\b", "_px": r"\bpx\b", "_m": r"\bm\b", "_s": r"\bs\b",
    "width": r"\bpx\b", "height": r"\bpx\b", "fovy": r"degrees", "fx": r"\bpx\b", "fy": r"\bpx\b", "cx": r"\bpx\b", "cy": r"\bpx\b",
    "time": r"\bs\b", "fps": r"\bHz\b", "matrix": r"\bpx\b", "span": r"\bs\b", "middle": r"\bs\b", "size": r"\bpx\b|columns and rows",
}  # fmt: skip
# A number without a unit: what it counts, or where it lies.
COUNTS = (
    r"\d to \d|\bnumber\b|\bcount|how many|\bseeds?\b|\bchance\b|\brays a pixel\b|\bsteps\b|exit code|square number|\bmean difference\b"
)
COUNTS += r"|\bbelow \d|times its value|\bas in MuJoCo\b|\bframes\b.*rewritten|\bof a machine\b|in steps of"
SHAPE = r"\((?:\w+, )*(?:height|width|n|rows|columns|number|5)\b[^)]*\)|\b[34]x4\b|\b3x3\b"
SHAPE += "|of the (?:same|camera's|picture's) shape|of that shape"
DTYPE = r"\bu?int\d+\b|\bfloat\d+\b|\bfloats?\b|4x4 matri|\b4x4\b|same kind|kind, type"
HANDED_ON = r"\bas of\b|\bas in\b|\bas (?:of )?`"
IN_PLACE = {"self", "cls", "args", "options", "given", "sample", "kwargs"}


def text_of(thing):
    """A docstring as one line; of a class, with that of its constructor."""
    told = inspect.getdoc(thing) or ""
    if inspect.isclass(thing) and inspect.isfunction(vars(thing).get("__init__")):
        told += "\n\n" + (inspect.getdoc(vars(thing)["__init__"]) or "")
    return re.sub(r"\s+", " ", told)


def function_of(thing):
    """The function whose signature counts, or None."""
    if inspect.isclass(thing):
        init = vars(thing).get("__init__")
        return init if inspect.isfunction(init) else None
    if isinstance(thing, property):
        return thing.fget
    return thing if inspect.isfunction(thing) else None


def clause(told, name, others):
    """What a docstring says of a parameter: from its name, past those that share the sentence, to the next one or the sentence's end."""
    found = []
    for match in re.finditer(rf"`{name}`", told):
        rest = told[match.end() :]
        rest = re.sub(r"^(?:(?:,| and| or) `\w+`)+", "", rest)
        ends = [len(rest)] + [m.start() for m in re.finditer(r"\. (?=[`A-Z(\"])|\.$", rest)]
        ends += [m.start() for other in others if other != name for m in re.finditer(rf"`{other}`", rest)]
        found.append(rest[: min(ends)])
    return " / ".join(found) if found else None


def _annotation(parameter):
    return "" if parameter is inspect.Parameter.empty else str(parameter)


def wanted_of(name, annotation):
    """Patterns that a clause, or a result's docstring, has to hold: each with what is missing where it does not."""
    elsewhere = re.search(r"\bPathLike\b|^str\b|^int\b", annotation) and name != "corners"
    if re.search(r"\bArray\b|NDArray", annotation) or (name in ARRAYS and not elsewhere):
        return [(SHAPE, "shape"), (DTYPE, "type")]
    bare = re.sub(r"(?:dict|list|Mapping|Sequence|type|Callable|Iterable)\[.*\]", "", annotation)
    if not re.search(r"\b(?:int|float)\b", bare):
        return []
    for ending, unit in UNITS.items():
        if name == ending or (ending.startswith("_") and name.endswith(ending)):
            return [(unit, f"unit {unit}")]
    return [(f"{COUNTS}|" + "|".join(UNITS.values()), "unit, range or what it counts")]


def parameters_of(thing):
    function = function_of(thing)
    if function is None or isinstance(thing, property):
        return {}
    signature = inspect.signature(function).parameters
    return {n: _annotation(p.annotation) for n, p in signature.items() if n not in IN_PLACE}


def what_is_unsaid(name, thing, public):
    """Sentences on parameters and results that say too little; `public`: docstrings of all public names."""
    told, parameters = text_of(thing), parameters_of(thing)
    if "For `Camera.submit` alone" in told:
        return []
    silent = []
    for parameter, annotation in parameters.items():
        said = clause(told, parameter, parameters)
        if said is None:
            targets = re.findall(r"(?:[Aa]rguments(?: and errors)?|all else) as of `([\w.]+)`|^As of the environments?", told)
            if not any(t == "" or parameter in public.get(t.rsplit(".")[-1], "") for t in targets):
                silent.append(f"{name}({parameter}): not told")
            continue
        silent += [
            f"{name}({parameter}): no {what} in {said[:80]!r}"
            for pattern, what in wanted_of(parameter, annotation)
            if not re.search(pattern, said) and not re.search(HANDED_ON, said)
        ]
    return silent + _unsaid_of_result(name, thing, told)


def _unsaid_of_result(name, thing, told):
    function = function_of(thing)
    if function is None or inspect.isclass(thing):
        return []
    annotation = _annotation(inspect.signature(function).return_annotation)
    if name in GIVES_ARRAYS:
        annotation = "Array"
    if re.match(r"int\b", annotation) and name.endswith("main"):
        annotation = ""
    last = name.rsplit(".")[-1]
    wanted = wanted_of("" if last in ARRAYS else last, annotation)
    return [
        f"{name} gives: no {what}"
        for pattern, what in wanted
        if not re.search(pattern, told) and not re.search(r"as of `|what `\w+` gives", told)
    ]


def attributes_unsaid(name, thing):
    """Sentences on public attributes that a class sets on itself and its docstring does not name."""
    if not inspect.isclass(thing) or not thing.__module__.startswith("shutterbug"):
        return []
    tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    stored = [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)]
    own = {n.attr for n in stored if isinstance(n.value, ast.Name) and n.value.id == "self" and not n.attr.startswith("_")}
    told = text_of(thing)
    return [f"{name}.{a}: an attribute that is not told" for a in sorted(own) if f"`{a}`" not in told]


# ---- Errors --------------------------------------------------------------------------------------------------------------

# Methods of Python's own that bear the same names as ours.
_COMMON = {"close", "get", "add", "append", "clear", "update", "draw", "start", "main", "join", "read", "run", "result", "wait"}
_FILES = {"read_text", "write_text", "read_bytes", "write_bytes", "open", "mkdir", "iterdir", "replace", "samefile"}
# Of the compiled part, what cannot fail.
_SAFE = {"VERSION", "statuses", "presets", "Poses", "Engine", "Frame", "times", "close"}


class Raises:
    """Which functions of the package can raise, by their source: on their own, or by what they call."""

    def __init__(self, folder):
        self._bodies, self._own = {}, {}
        for file in sorted(Path(folder).glob("*.py")):
            self._read(file.stem, ast.parse(file.read_text("utf-8")))
        self._can = {key for key, found in self._own.items() if found}
        while True:
            more = {key for key, calls in self._bodies.items() if key not in self._can and any(self._reaches(key, c) for c in calls)}
            if not more:
                break
            self._can |= more

    def _read(self, module, tree):
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                self._note((module, "", node.name), node)
            elif isinstance(node, ast.ClassDef):
                for inner in node.body:
                    if isinstance(inner, ast.FunctionDef):
                        self._note((module, node.name, inner.name), inner)

    def _note(self, key, function):
        calls, own = set(), set()
        tries = [t for t in ast.walk(function) if isinstance(t, ast.Try)]
        caught = {id(n) for t in tries for h in t.handlers for n in ast.walk(h)}
        # What it catches itself does not leave it.
        kept = [t for t in tries if any("ShutterbugError" in ast.unparse(h.type) for h in t.handlers if h.type)]
        sheltered = {id(n) for t in kept for s in t.body for n in ast.walk(s)}
        for node in (n for n in ast.walk(function) if id(n) not in sheltered):
            if isinstance(node, ast.Raise) and node.exc is not None and not (id(node) in caught and isinstance(node.exc, ast.Name)):
                kind = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
                if isinstance(kind, ast.Name) and kind.id != "NotImplementedError":
                    own.add(kind.id)
            elif isinstance(node, ast.Attribute):
                receiver = ast.unparse(node.value)
                calls.add((receiver, node.attr))
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                calls.add(("", node.func.id))
        self._bodies[key], self._own[key] = calls, own

    def _reaches(self, key, call):
        """Whether a call of `key` is one that can raise."""
        receiver, name = call
        if re.search(r"\b_core$", receiver):
            return name not in _SAFE
        if receiver == "super()":
            return False
        if receiver == "":
            return any(k in self._can for k in self._bodies if (k[1], k[2]) in (("", name), (name, "__init__")))
        if receiver in ("self", "cls"):
            return (key[0], key[1], name) in self._can
        if name in _FILES and "os.environ" not in receiver:
            return True
        return name not in _COMMON and any(k in self._can for k in self._bodies if k[2] == name and k[1])

    def of(self, function):
        """(errors that its own body raises, whether it can raise at all)."""
        module, place = function.__module__.split(".")[-1], function.__qualname__.split(".")
        if function.__module__ == "shutterbug":
            module = "__init__"
        key = (module, place[-2] if len(place) > 1 else "", place[-1])
        if key not in self._bodies:
            return set(), False
        return self._own[key], key in self._can


def errors_unsaid(name, thing, raises, public=None):
    """Sentences on errors that a docstring does not name, nor one of those that it hands this on to; `public`: all docstrings."""
    function = function_of(thing)
    if function is None or not function.__module__.startswith("shutterbug"):
        return []
    own, can = raises.of(function)
    told = text_of(thing)
    if "For `Camera.submit` alone" in told:
        return []
    handed = re.findall(r"[Ee]rrors as of `([\w.]+)`", told)
    unknown = [target for target in handed if target.rsplit(".")[-1] not in (public or {})]
    silent = [f"{name}: hands its errors on to {target}, which is no public name" for target in unknown]
    theirs = " ".join((public or {}).get(target.rsplit(".")[-1], "") for target in handed)
    silent += [f"{name}: raises {kind} and does not say so" for kind in sorted(own) if kind not in told + theirs]
    if can and not re.search(r"[A-Z]\w*Error\b|SystemExit", told + theirs):
        silent.append(f"{name}: what it calls can raise, and it does not say so")
    return silent


def source_of(code):
    """A function of a piece of source, for the controls."""
    names = {}
    exec(compile(textwrap.dedent(code), "control", "exec"), names)
    return next(value for key, value in names.items() if not key.startswith("__") and callable(value))
