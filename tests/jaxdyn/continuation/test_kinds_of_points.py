"""Kinds of special points: what a wrong name is told."""

import copy
import pickle

import pytest

from jaxdyn.continuation import CodimensionTwo, Kind


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("PERIOD_DOUBLING", "DOUBLING"),
        ("BRANCH_POINT", "BRANCH"),
        ("Fold", "FOLD"),
        ("NEIMARK_SACKER", ""),
    ],
)
def test_an_unknown_member_suggests_the_nearest(name, nearest):
    with pytest.raises(AttributeError, match=f"Kind has no '{name}'") as told:
        getattr(Kind, name)
    assert str(told.value).endswith(f"Did you mean Kind.{nearest}?" if nearest else "GRAZING.")


def test_what_a_kind_prints_makes_it():
    for kinds in (Kind, CodimensionTwo):
        for member in kinds:
            assert kinds(str(member)) is member
            assert pickle.loads(pickle.dumps(member)) is copy.deepcopy(member) is member
    with pytest.raises(ValueError, match="Did you mean 'period doubling'"):
        Kind("period doublin")
    assert not hasattr(Kind, "PERIOD_DOUBLING")
