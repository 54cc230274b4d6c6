"""What public functions accept: lists for arrays, and numbers of the right shape only."""

import inspect
import math
import typing

import equinox as eqx
import jax
import numpy as np
import pytest
from helpers import gap

import jaxdyn
from jaxdyn import effects, scenes
from jaxdyn.analysis import precession
from jaxdyn.geometry import balance, euler, frames, indices, inertia, kinematics, rotations, vectors
from jaxdyn.geometry.rotations import AxisAngle
from jaxdyn.integrate import events
from jaxdyn.scene import Scene
from jaxdyn.scenes import catalogue

_CONFIGURE = r"^floats: expected 64-bit floats, got .*Call jaxdyn\.configure\(\) first\."
RNG = np.random.default_rng(3)
ROTATION = np.asarray(rotations.matrix_from_rotation_vector([0.3, -0.4, 0.5]))
#: What stands for arguments that are not arrays, or more than any numbers, by name.
OTHERS = {
    "sequence": "ZYX",
    "iterations": 10,
    "name": "R",
    "body": inertia.box(2.0, [1.0, 2.0, 3.0]),
    "position": lambda q: q * q,
    "first": AxisAngle([0.0, 0.0, 1.0], 0.3),
    "then": AxisAngle([1.0, 0.0, 0.0], 0.4),
}
OBJECTS = {*OTHERS, "self"}


def _public(*modules):
    for module in modules:
        for name, function in vars(module).items():
            own = inspect.isfunction(function) and function.__module__ == module.__name__
            if own and not name.startswith("_"):
                yield function


TOOLS = [
    *_public(vectors, rotations, frames, euler, balance, kinematics, inertia),
    precession.free_attitude,
    *(inertia.Body.shifted, inertia.Body.rotated, inertia.Body.about),
]
WITH_ARRAYS = [f for f in TOOLS if "jaxtyping" in str(inspect.signature(f).parameters)]


def _example(name: str, annotation):
    """Numbers of the shape that an annotation names, with a place for each axis."""
    if name in OTHERS:
        return OTHERS[name]
    if name == "self":
        return OTHERS["body"]
    axes = [3 if x == "..." else int(x) if x.isdigit() else 2 for x in annotation.dim_str.split()]
    if axes == [3, 3]:
        return ROTATION
    return np.asarray(RNG.uniform(0.5, 1.5, axes[:1] if "..." in annotation.dim_str else axes))


def _listed(x):
    """Numbers as a caller writes them down."""
    if isinstance(x, AxisAngle):
        return AxisAngle(list(x.axis), x.angle)
    return x.tolist() if isinstance(x, np.ndarray) else x


def _called(function, given: dict):
    """The call with those arguments by keyword that can only be so given."""
    kinds = inspect.signature(function).parameters
    named = {n: x for n, x in given.items() if kinds[n].kind is kinds[n].KEYWORD_ONLY}
    return function(*(x for n, x in given.items() if n not in named), **named)


def _examples(function) -> dict:
    hints = inspect.signature(function).parameters
    return {name: _example(name, p.annotation) for name, p in hints.items()}


@pytest.mark.parametrize("function", TOOLS, ids=lambda f: f.__qualname__)
def test_lists_do_as_well_as_arrays(function):
    given = _examples(function)
    lists = {name: _listed(x) for name, x in given.items()}
    by_arrays, by_lists = (_called(function, x) for x in (given, lists))
    leaves = jax.tree.leaves(by_arrays)
    assert leaves
    for one, other in zip(leaves, jax.tree.leaves(by_lists), strict=True):
        assert np.isfinite(np.asarray(one)).all()
        assert gap(np.asarray(one, float), np.asarray(other, float)) == 0


@pytest.mark.parametrize("function", TOOLS, ids=lambda f: f.__qualname__)
def test_floats_of_32_bits_are_refused(function):
    lists = {name: _listed(x) for name, x in _examples(function).items()}
    with jax.enable_x64(False), pytest.raises(ValueError, match=_CONFIGURE):
        _called(function, lists)


def test_what_is_made_of_32_bits_is_refused_in_64():
    # It would keep what it lost.
    with jax.enable_x64(False):
        ball, drag = scenes.cannonball(), effects.QuadraticDrag(0.1)
        ground = events.Reaches(1, 0.1, -1)
    for scene, name in ((ball, "scene"), (scenes.cannonball() + drag, "QuadraticDrag")):
        with pytest.raises(ValueError, match=f"{name}: expected 64-bit floats, .* Make it again"):
            jaxdyn.simulate(scene)
    with pytest.raises(ValueError, match=r"event: expected 64-bit floats, .* Make it again\."):
        jaxdyn.until(scenes.cannonball(), ground)


def test_sums_over_indices_are_refused_in_32_bits():
    with jax.enable_x64(False), pytest.raises(ValueError, match=_CONFIGURE):
        _index_sum()


def _index_sum():
    return indices.evaluate_indices("a_i b_i", a=[1.0, 2.0, 3.0], b=[1.0, 2.0, 3.0])


def _wrong(x: np.ndarray, axes: str) -> list:
    """Numbers with one axis too many, and with one row too few where the rows are counted."""
    more = [] if "..." in axes else [np.stack([x, x])]
    return more + ([x[:-1]] if axes[:1].isdigit() else [])


@pytest.mark.parametrize("function", WITH_ARRAYS, ids=lambda f: f.__qualname__)
def test_another_shape_is_refused(function):
    given = _examples(function)
    for name, p in inspect.signature(function).parameters.items():
        for bad in _wrong(given[name], p.annotation.dim_str) if name not in OBJECTS else ():
            with pytest.raises(ValueError, match=rf"^{name}: expected shape \(.*, got shape \("):
                _called(function, given | {name: bad})


def test_what_is_no_body_is_refused():
    for function in (inertia.principal, inertia.is_flat, inertia.equimomental):
        with pytest.raises(ValueError, match=r"^body: expected a Body, got int\.$"):
            function(3)
    with pytest.raises(ValueError, match=r"^body: expected a Body, got list\.$"):
        balance.bearing_forces([1.0], [0, 0, -1], [0, 0, 1], 2)


def test_text_and_truths_are_no_numbers():
    with pytest.raises(ValueError, match=r"^theta: expected numbers, got 'pi'"):
        rotations.rotate([0, 0, 1], "pi", [1, 2, 3])
    with pytest.raises(ValueError, match=r"^r: expected numbers, got \[True, 2, 3\]"):
        rotations.rotate([0, 0, 1], math.pi, [True, 2, 3])


def test_a_quarter_turn_of_lists():
    assert gap(rotations.rotate([0, 0, 1], math.pi / 2, [1, 2, 3]), [-2.0, 1.0, 3.0]) < 1e-15
    slope = jax.jacfwd(lambda t: rotations.rotate([0, 0, 1], t, [1, 2, 3]))(0.0)
    assert gap(slope, [-2.0, 1.0, 0.0]) < 1e-15


def _numeric(default) -> bool:
    return isinstance(default, int | float | tuple | np.ndarray) and not isinstance(default, bool)


NUMBERS = [
    pytest.param(entry.make, key, default, id=f"{name}-{key}")
    for name, entry in catalogue.entries().items()
    for key, default in entry.parameters.items()
    if _numeric(default) and default != () and (name, key) != ("rod_on_line", "speed")
    if name != "linear_system"  # one number for all, as in chains: see their own tests
    if key != "damping" or name == "pendulum"  # likewise
    if name != "spring_chain" or np.ndim(default) == 0
]


#: Scenes of as many bars as there are masses, or of as many dimensions as a place has entries.
MANY = {"n_pendulum", "pinned_chain", "skate_chain", "particle", "spring_mass", "hanging_spring"}


@pytest.mark.parametrize(("make", "name", "default"), NUMBERS)
def test_a_scene_takes_numbers_of_the_shape_of_its_defaults(make, name, default):
    one = np.asarray(default, float)
    wrong = [one[:0], one[0]] if one.ndim else [one[None], np.stack([one, one])]
    if make.__name__ not in MANY:
        wrong += [one[:1], np.concatenate([one, one[-1:]])] if one.ndim else []
    for bad in wrong:
        with pytest.raises(ValueError, match=r"^\w+: expected shape \(.*, got shape \("):
            typing.cast(Scene, make(**{name: bad})).check()


def test_rows_of_a_chain_are_as_many_as_its_masses():
    make = catalogue.entries()["n_pendulum"].make
    with pytest.raises(
        ValueError, match=r"^length: expected shape \(2,\), got .* each entry of m\.$"
    ):
        make(m=(1, 1), angles=(1, 1), rates=(0, 0))
    make(m=(1, 1), length=[1, 2], angles=(1, 1), rates=(0, 0)).check()


def test_the_old_name_of_a_length_warns():
    with pytest.warns(DeprecationWarning, match="l of double_pendulum is now length"):
        old = scenes.double_pendulum(l=(1.0, 0.5))  # pyright: ignore[reportCallIssue]
    new = scenes.double_pendulum(length=(1.0, 0.5))
    assert eqx.tree_equal(old, new)
    with pytest.warns(DeprecationWarning, match="l of four_bar is now length"):
        assert eqx.tree_equal(
            catalogue.build("four_bar", {"l": "1, 2, 3"}), scenes.four_bar(length=(1, 2, 3))
        )
    with pytest.raises(ValueError, match=r"keyword of rimless_wheel: expected .*, got 'l'"):
        scenes.rimless_wheel(l=1.0, length=2.0)  # pyright: ignore[reportCallIssue]
    with pytest.raises(ValueError, match=r"keyword of pendulum: expected .*, got 'l'"):
        scenes.pendulum(l=1.0)  # pyright: ignore[reportCallIssue]


@pytest.mark.slow
def test_shapes_of_scenes_are_those_under_traces_too():
    make = catalogue.entries()["cart_pendulum"].make
    with pytest.raises(ValueError, match=r"^m: expected shape \(2,\), got shape \(1,\)"):
        jax.jit(lambda m: make(m=(m,)).y0)(1.0)
    slope = jax.grad(lambda m: make(m=(m, 1.0)).rate(0.0, make().y0)[2])(1.0)
    assert np.isfinite(slope)


def test_a_keyword_that_a_scene_does_not_have_is_told_with_those_that_it_has():
    make = catalogue.entries()["cannonball"].make
    known = "keyword of cannonball: expected one of angle, drag, g, linear, m, speed, t1"
    with pytest.raises(ValueError, match=f"^{known}, got 'velocity'"):
        make(velocity=3)
    with pytest.raises(ValueError, match=r"got 'sped'\. Did you mean 'speed'\?$"):
        make(sped=3)
