"""What is known of a scene before an orbit is looked for."""

import math

import pytest

import orbits
from jaxdyn import scenes
from orbits.closing.given import driven


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (scenes.shaken_pendulum(), True),
        (scenes.shaken_pendulum(angle=0.0), True),  # whose rest the drive leaves at rest
        (scenes.pendulum(angle=0.0), False),
        (scenes.three_body(), False),
    ],
)
def test_a_drive_is_seen_at_rest_too(scene, expected):
    assert driven(scene) == expected


def test_the_rest_of_a_driven_scene_is_an_orbit():
    upright = orbits.find(scenes.shaken_pendulum(angle=0.0), period=2 * math.pi / 60)
    assert upright.ok
    assert orbits.stability(upright).verdict == "stable"
