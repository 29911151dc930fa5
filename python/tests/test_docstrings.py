"""Every public name says what it is: parameters and results with units, shapes and types, and the errors that it raises."""

import importlib
import importlib.util
import inspect
from pathlib import Path

import docstrings
import pytest

import shutterbug

MODULES = ["", ".mujoco", ".gymnasium", ".newton", ".blender", ".transforms", ".bag", ".fleet", ".ray", ".errors"]
NEEDS = {".mujoco": "mujoco", ".gymnasium": "gymnasium mujoco", ".newton": "newton", ".blender": "bpy", ".bag": "mcap_ros2", ".ray": "ray"}


def public_things():
    """Functions, classes, methods and properties that anyone may use, by their names."""
    for name in MODULES:
        if not all(map(importlib.util.find_spec, NEEDS.get(name, "").split())):
            continue
        module = importlib.import_module("shutterbug" + name)
        yield module.__name__, module
        for public in module.__all__:
            thing = getattr(module, public)
            yield f"{module.__name__}.{public}", thing
            if inspect.isclass(thing) and thing.__module__.startswith("shutterbug"):
                for member, value in vars(thing).items():
                    callable_ = inspect.isfunction(value) or isinstance(value, property | classmethod | staticmethod)
                    if callable_ and (not member.startswith("_") or member == "__call__"):
                        yield f"{module.__name__}.{public}.{member}", getattr(value, "__func__", value)


@pytest.fixture(scope="module")
def public():
    return {n: t for n, t in public_things() if not isinstance(t, str) and not inspect.ismodule(t)}


@pytest.fixture(scope="module")
def raises():
    return docstrings.Raises(Path(shutterbug.__file__).parent)


def test_every_public_name_says_what_it_is():
    told = dict(public_things())
    silent = [n for n, t in told.items() if not isinstance(t, str) and len(inspect.getdoc(t) or "") < 12]
    assert len(told) > 90 and silent == []


@pytest.fixture(scope="module")
def told(public):
    """Docstrings by the last part of their names: of several with one name, all."""
    texts = {}
    for name, thing in public.items():
        last = name.rsplit(".", 1)[-1]
        texts[last] = f"{texts.get(last, '')} {docstrings.text_of(thing)}"
    return texts


def test_parameters_and_results_have_units_shapes_and_types(public, told):
    silent = [s for n, t in public.items() for s in docstrings.what_is_unsaid(n, t, told)]
    assert silent == [], "\n".join(silent)


def test_attributes_are_told(public, tmp_path, monkeypatch):
    assert [s for n, t in public.items() for s in docstrings.attributes_unsaid(n, t)] == []
    # The control.
    source = 'class Silent:\n    """Has `told`."""\n\n    def __init__(self):\n        self.told, self.untold, self._inner = 1, 2, 3\n'
    (tmp_path / "shutterbug_silent.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    silent = importlib.import_module("shutterbug_silent").Silent
    assert docstrings.attributes_unsaid("Silent", silent) == ["Silent.untold: an attribute that is not told"]


def test_what_can_raise_says_so(public, raises, told):
    silent = [s for n, t in public.items() for s in docstrings.errors_unsaid(n, t, raises, told)]
    assert silent == [], "\n".join(silent)


CONTROLS = {
    # Sound, then without a unit, a shape, a type, a parameter, a unit of the result.
    "sound": ('''def f(rate_hz: float, rgb: "Array", seed: int = 0) -> float:
        """Give a margin, px. `rate_hz`: Hz. `rgb`: (height, width, 3) of uint8. `seed`: a number, 0 to 9."""''', []),
    "no unit": ('''def f(rate_hz: float) -> None:
        """Do it. `rate_hz`: how quick. Takes 3 Hz."""''', ["unit"]),
    "no shape": ('''def f(rgb: "Array") -> None:
        """Do it. `rgb`: uint8."""''', ["shape"]),
    "no type": ('''def f(rgb: "Array") -> None:
        """Do it. `rgb`: (height, width, 3)."""''', ["type"]),
    "another's unit": ('''def f(time_s: float, speed_m_s: float) -> None:
        """Do it. `time_s`: when, and `speed_m_s`: m/s in 1 s."""''', ["unit"]),
    "no parameter": ('''def f(rate_hz: float, seed: int) -> None:
        """Do it. `rate_hz`: Hz."""''', ["seed"]),
    "no unit of the result": ('''def middle(rate_hz: float) -> float:
        """Give the middle. `rate_hz`: Hz."""''', ["gives"]),
    "handed on to what does not say it": ('''def f(rate_hz: float) -> None:
        """Do it; arguments as of `other`."""''', ["not told"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CONTROLS)
def test_a_docstring_that_says_too_little_is_found(case):
    """The control of the check: each of these lacks what its name says, and nothing else."""
    code, missing = CONTROLS[case]
    function = docstrings.source_of(code)
    found = docstrings.what_is_unsaid("f" if function.__name__ == "f" else "m.middle", function, {"other": "`speed`: m/s."})
    assert len(found) == len(missing) and all(m in f for m, f in zip(missing, found, strict=True)), found


def test_an_error_that_is_not_named_is_found(tmp_path):
    """The control: on its own, by what it calls, by the compiled part, by a file; and what cannot raise is left alone."""
    (tmp_path / "made.py").write_text(
        'def own(x):\n    """Nothing."""\n    raise ValueError("x")\n'
        'def by_call(x):\n    """Nothing."""\n    return own(x)\n'
        'def by_core(x):\n    """Nothing."""\n    return _core.check_camera(x)\n'
        'def by_file(x):\n    """Nothing."""\n    return x.read_text()\n'
        'def safe(x):\n    """Nothing."""\n    return len(x)\n'
        'def told(x):\n    """Nothing. ValueError: always."""\n    raise ValueError("x")\n'
        'def handed(x):\n    """Nothing. Errors as of `told`."""\n    raise ValueError("x")\n'
        'def astray(x):\n    """Nothing. Errors as of `safe`."""\n    raise ValueError("x")\n'
        'def caught(x):\n    """Nothing."""\n    try:\n        return own(x)\n    except ShutterbugError:\n        return 1\n'
    )
    names = {"__name__": "shutterbug.made"}
    exec(compile((tmp_path / "made.py").read_text(), "made", "exec"), names)
    raises = docstrings.Raises(tmp_path)
    functions = {n: f for n, f in names.items() if inspect.isfunction(f)}
    texts = {n: docstrings.text_of(f) for n, f in functions.items()}
    found = [n for n, f in functions.items() if docstrings.errors_unsaid(n, f, raises, texts)]
    assert found == ["own", "by_call", "by_core", "by_file", "astray"]
