"""A system around another answers every question of `System` as the one inside does."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import gap

from jaxdyn import System
from jaxdyn.analysis.regularized import LogarithmicTime
from jaxdyn.analysis.work_by_effect import WorkByEffect
from jaxdyn.formulations.extended import Extended
from jaxdyn.scene import Points
from jaxdyn.scenes.central import _SweptAngle
from jaxdyn.sketch import Shape

TIME, INNER, EFFECTS = 0.7, np.array([0.3, -0.2, 0.5, 1.1]), ("an effect",)


class Answers(System):
    """Every answer depends on all that is asked, and none is the default one."""

    def labels(self):
        return ("x", "m"), ("angle", "rad"), ("vx", "m/s"), ("rate", "rad/s")

    def parameter_names(self):
        return {"params": ("stiffness",)}

    def rate(self, t, y, effects):
        return jnp.stack([y[2], y[3], t - y[0], 2.0 * y[1]])

    def points(self, t, y):
        return Points(t + y[None, :2], y[None, 2:], jnp.ones(1))

    def places(self, t, y):
        return t + 2 * y[None, :2]

    def sketch(self, t, y):
        return (Shape("line", np.full((2, 2), t + y[0])),)

    def bodies(self, t, y):
        return (t + y[0],)

    def joints(self, t, y):
        return (t + y[1],)

    def loads(self, t, y):
        return (t + y[2],)

    def constraint_forces(self, t, y, effects):
        return t + y + len(effects)

    @property
    def accepts(self):
        return frozenset({"generalized"})

    @property
    def singular(self):
        return "Somewhere."

    def base_units(self):
        return "km", "", "day"

    @property
    def second_order(self):
        return True

    def coordinates(self, y):
        return y[:2] + 1.0, y[2:] + 2.0

    def kinetic(self, t, y):
        return t * y[0]

    def bounds(self, t, y, effects):
        return {"the stop": t + y[0] + len(effects)}

    def energies(self, t, y, effects):
        return (t + y[1] + len(effects),)

    def integrals(self, t, y):
        return {"of motion": t - y[3]}

    def difference(self, y1, y0):
        return 2.0 * (y1 - y0)

    def project(self, t, y):
        return t * y

    def undetermined(self, t, y):
        return t * y[1] > 1.0

    def loses(self, t0, y0, t1, y1):
        return t1 * y1[1] - t0 * y0[0]

    def canonical(self, t, y):
        return t + y

    def generators(self, y):
        return {"along x": 3.0 * y}

    def check(self, t, y):
        raise ValueError(f"checked at {t} {list(map(float, y))}")

    def check_effects(self, t, y, effects):
        """Nothing is wrong."""


#: (system, whole state, further entries)
CASES = [
    (WorkByEffect(Answers(), ("LinearDrag",)), np.append(INNER, 0.4), 1),
    (LogarithmicTime(Answers()), np.append(INNER, [0.4, TIME]), 2),
    (_SweptAngle(Answers()), np.append(INNER, 9.0), 1),
]
QUESTIONS = {
    "points": lambda s, t, y: s.points(t, y),
    "places": lambda s, t, y: s.places(t, y),
    "sketch": lambda s, t, y: s.sketch(t, y)[0].at,
    "bodies": lambda s, t, y: s.bodies(t, y)[0],
    "joints": lambda s, t, y: s.joints(t, y)[0],
    "loads": lambda s, t, y: s.loads(t, y)[0],
    "constraint_forces": lambda s, t, y: s.constraint_forces(t, y, EFFECTS),
    "base_units": lambda s, t, y: s.base_units(),
    "accepts": lambda s, t, y: s.accepts,
    "parameter_names": lambda s, t, y: frozenset(s.parameter_names().items()),
    "singular": lambda s, t, y: s.singular,
    "coordinates": lambda s, t, y: s.coordinates(y),
    "kinetic": lambda s, t, y: s.kinetic(t, y),
    "bounds": lambda s, t, y: s.bounds(t, y, EFFECTS)["the stop"],
    "energies": lambda s, t, y: s.energies(t, y, EFFECTS),
    "integrals": lambda s, t, y: s.integrals(t, y)["of motion"],
    "undetermined": lambda s, t, y: s.undetermined(t, y),
    "loses": lambda s, t, y: s.loses(t, y, t, y),
}
#: Answers with an entry for each of the state.
OF_STATES = {
    "difference": lambda s, t, y: s.difference(y, 0.5 * y),
    "project": lambda s, t, y: s.project(t, y),
    "generators": lambda s, t, y: s.generators(y)["along x"],
}
OWN = {"labels", "rate", "check", "check_effects"}
OLD_NAMES = {"cut", "held"}
#: What further entries take away: see there.
NOT_ANY_MORE = {"second_order": False, "canonical": None}


def test_every_question_is_answered_here():
    asked = {name for name in vars(System) if not name.startswith("_")} - OLD_NAMES
    assert asked == {*QUESTIONS, *OF_STATES, *OWN, *NOT_ANY_MORE}
    answered = set(vars(Extended)) | Extended.__abstractmethods__
    assert asked <= answered
    # Nor does an answer of the system inside happen to be the default.
    assert asked <= set(vars(Answers))


@pytest.mark.parametrize(("system", "y", "more"), CASES, ids=lambda x: type(x).__name__)
def test_the_answer_is_that_of_the_system_inside(system, y, more):
    t = 0.0 if isinstance(system, LogarithmicTime) else TIME  # its state has the time
    inside = system.system
    for ask in QUESTIONS.values():
        here, there = ask(system, t, y), ask(inside, TIME, INNER)
        assert here == there if isinstance(there, str | frozenset) else _same(here, there)
    for name, ask in OF_STATES.items():
        here, there = ask(system, t, y), ask(inside, TIME, INNER)
        assert gap(here[:4], there) == 0
        rest = {"difference": 0.5 * y[4:], "project": y[4:], "generators": np.zeros(more)}[name]
        assert gap(here[4:], rest) == 0
    assert system.labels()[:4] == inside.labels()
    assert len(system.labels()) == len(y)
    with pytest.raises(ValueError, match=r"checked at 0\.7 \[0\.3, -0\.2, 0\.5, 1\.1\]"):
        system.check(t, y)
    assert system.second_order is NOT_ANY_MORE["second_order"]
    assert system.canonical(t, y) is NOT_ANY_MORE["canonical"]


def _same(here, there) -> bool:
    pairs = zip(here, there, strict=True) if isinstance(there, tuple) else [(here, there)]
    return all(np.array_equal(a, b) for a, b in pairs)


def test_without_constraints_nothing_is_projected():
    class Free(Answers):
        project = System.project

    y = np.append(INNER, 0.4)
    assert WorkByEffect(Free(), ("LinearDrag",)).project(TIME, y) is y
