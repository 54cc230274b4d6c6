"""What the player refuses: anything but motions, or a mapping of names to them."""

import pytest

from jaxdyn import player, scenes, simulate


def test_a_list_of_motions_is_refused_with_what_to_pass_instead():
    motion = simulate(scenes.pendulum(), 1.0, samples=5)
    with pytest.raises(ValueError, match=r"a mapping of names to motions, got list.*'?first"):
        player.export([motion, motion])
