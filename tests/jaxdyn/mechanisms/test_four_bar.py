"""The four-bar linkage: a parallelogram, mirror images, change points."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

from jaxdyn.scenes import linkages

NOW = jnp.zeros(())


@pytest.mark.slow
def test_parallelogram_swings_as_a_pendulum():
    # Coupler without rotation: (m1/3 + m2 + m3/3) l theta'' = -(m1/2 + m2 + m3/2) g sin(theta).
    numbers = {"m": (1.0, 2.0, 1.5), "l": (1.2, 2.0, 1.2), "ground": 2.0, "g": 3.0}
    numbers |= {"crossed": True}  # hanging, the coupler lies right of the line to the far hinge
    a = -(0.5 + 2.0 + 0.75) * 3.0 * np.sin(0.7) / ((1.0 + 6.0 + 1.5) / 3 * 1.2)
    entries = {"newton_euler": (0,), "lagrange": (0,), "loop": (0, 2), "constrained": (2, 8)}
    for formulation, which in entries.items():
        scene = linkages.four_bar(**numbers, angle=0.7, rate=0.4, formulation=formulation)
        acceleration = jnp.split(scene.rate(NOW, scene.y0), 2)[1]
        for i in which:
            assert gap(acceleration[i], a) < EXACT * 100


def test_crossed_linkage_is_the_mirror_image():
    scene = linkages.four_bar(ground=2.0, l=(1.0, 2.0, 2.0), angle=np.pi / 2)
    crossed = linkages.four_bar(ground=2.0, l=(1.0, 2.0, 2.0), angle=np.pi / 2, crossed=True)
    r, mirrored = (s.system.points(NOW, s.y0).r for s in (scene, crossed))
    assert gap(r, mirrored * jnp.array([[1.0, -1.0]])) < EXACT


@pytest.mark.parametrize("formulation", ["constrained", "loop", "newton_euler", "lagrange"])
def test_a_linkage_at_its_change_point_is_refused_by_name(formulation):
    for angle, rate in ((np.pi / 2, 0.0), (-np.pi / 2, 1.0)):
        with pytest.raises(
            ValueError, match=r"^angle: expected .* are not in line, got .*change poi"
        ):
            linkages.four_bar(
                l=(1.0, 2.0, 1.0), ground=2.0, angle=angle, rate=rate, formulation=formulation
            )
    with pytest.raises(ValueError, match=r"^angle: expected .* reach the far hinge, got"):
        linkages.four_bar(l=(2.0, 1.0, 1.5), ground=1.0, angle=-1.5, formulation=formulation)
