"""Which stretches of a family are named in a legend."""

from jaxdyn.drawing.bifurcations import stretches


def test_a_change_of_verdict_is_not_named_undecided():
    points = ["stable", "stable", "unstable", "unstable"]
    found = stretches(points, str)
    assert [(which, shown) for which, _, shown in found] == [
        ("stable", True),
        ("undecided", False),
        ("unstable", True),
    ]
    assert [several for _, several, _ in found] == [points[:2], points[1:3], points[2:]]


def test_points_without_a_verdict_are_named():
    found = stretches(["stable", "undecided", "unstable"], str)
    assert [(which, shown) for which, _, shown in found] == [("undecided", True)]
