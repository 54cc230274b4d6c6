"""The four-bar linkage: a parallelogram, mirror images, change points."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, refusal

from jaxdyn import Status, simulate
from jaxdyn.hard.cases.dependent import folding_bars
from jaxdyn.scenes import linkages

NOW = jnp.zeros(())
SLOW = pytest.mark.slow


@pytest.mark.slow
def test_parallelogram_swings_as_a_pendulum():
    # Coupler without rotation: (m1/3 + m2 + m3/3) l theta'' = -(m1/2 + m2 + m3/2) g sin(theta).
    numbers = {"m": (1.0, 2.0, 1.5), "length": (1.2, 2.0, 1.2), "ground": 2.0, "g": 3.0}
    numbers |= {"crossed": True}  # hanging, the coupler lies right of the line to the far hinge
    a = -(0.5 + 2.0 + 0.75) * 3.0 * np.sin(0.7) / ((1.0 + 6.0 + 1.5) / 3 * 1.2)
    entries = {"newton_euler": (0,), "lagrange": (0,), "loop": (0, 2), "constrained": (2, 8)}
    for formulation, which in entries.items():
        scene = linkages.four_bar(**numbers, angle=0.7, rate=0.4, formulation=formulation)
        acceleration = jnp.split(scene.rate(NOW, scene.y0), 2)[1]
        for i in which:
            assert gap(acceleration[i], a) < EXACT * 100


def test_crossed_linkage_is_the_mirror_image():
    scene = linkages.four_bar(ground=2.0, length=(1.0, 2.0, 2.0), angle=np.pi / 2)
    crossed = linkages.four_bar(ground=2.0, length=(1.0, 2.0, 2.0), angle=np.pi / 2, crossed=True)
    r, mirrored = (s.system.points(NOW, s.y0).r for s in (scene, crossed))
    assert gap(r, mirrored * jnp.array([[1.0, -1.0]])) < EXACT


@pytest.mark.parametrize("formulation", ["constrained", "loop", "newton_euler", "lagrange"])
def test_a_linkage_at_its_change_point_is_refused_by_name(formulation):
    for angle, rate in ((np.pi / 2, 0.0), (-np.pi / 2, 1.0)):
        with pytest.raises(
            ValueError, match=r"^angle: expected .* are not in line, got .*change poi"
        ):
            linkages.four_bar(
                length=(1.0, 2.0, 1.0), ground=2.0, angle=angle, rate=rate, formulation=formulation
            )
    with pytest.raises(ValueError, match=r"^angle: expected .* reach the far hinge, got"):
        linkages.four_bar(length=(2.0, 1.0, 1.5), ground=1.0, angle=-1.5, formulation=formulation)


def test_a_pose_where_the_bars_lose_rank_is_refused_with_the_remedy():
    said = refusal(folding_bars(0.0).check)
    assert said.startswith("y0: expected a pose whose constraints determine the motion, got one ")
    assert said.endswith(
        "It could continue in several ways (a linkage at a dead centre); start beside it."
    )
    folding_bars(1e-3).check()


def test_a_step_past_two_change_points_is_refused_too():
    # It turns evenly, so that a step of a Runge-Kutta pair takes it round by more than half a turn.
    scene = linkages.four_bar(
        **{"length": (1.0, 2.0, 1.0), "ground": 2.0, "g": 0.0, "angle": 0.1, "rate": 0.5},
        crossed=True,
        formulation="loop",
    )
    for rtol in (1e-2, 1e-4, 1e-6):
        end = simulate(scene, 24.0, samples=2, rtol=rtol, throw=False)
        assert end.status_code in (Status.SINGULAR, Status.STEP_COLLAPSED)


@pytest.mark.slow
@pytest.mark.parametrize(
    "formulation",
    ["newton_euler", "lagrange", *(pytest.param(x, marks=SLOW) for x in ("loop", "constrained"))],
)
@pytest.mark.parametrize("crossed", [False, True])
def test_a_motion_through_a_change_point_is_refused_there(formulation, crossed):
    # Without gravity the crossed start, a parallelogram, turns evenly: flat at 90 degrees.
    flat = (np.pi / 2 - 0.7) / 2
    scene = linkages.four_bar(
        **{"length": (1.0, 2.0, 1.0), "ground": 2.0, "g": 0.0, "angle": 0.7, "rate": 2.0},
        crossed=crossed,
        formulation=formulation,
    )
    for rtol in (1e-4, 1e-6, 1e-8):
        motion = simulate(scene, 1.5, samples=16, rtol=rtol, throw=False)
        assert motion.status_code in (Status.SINGULAR, Status.STEP_COLLAPSED)
        assert "in two ways" in motion.message or "more than one way" in motion.message
        assert np.isnan(motion.ys[-1]).all()
        if crossed:
            reached = np.asarray(motion.ts) < flat - 0.1
            angle = np.asarray(motion[scene.labels()[2 if formulation == "constrained" else 0][0]])
            assert gap(angle[reached], 0.7 + 2.0 * motion.ts[reached]) < 100 * rtol
            assert np.isnan(angle[np.asarray(motion.ts) > flat]).all()
