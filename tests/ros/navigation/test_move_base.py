"""Effects of a goal that move_base alone has."""

from __future__ import annotations

from tests.sides.visitor import place


def test_what_navigation_says_is_passed_on(traveller, fault):
    fault("navigation_fails")
    end = traveller.ended(traveller.go_away())
    assert end.outcome == "failed"
    assert end.text == (
        "Navigation said: Failed to find a valid plan. Even after executing recovery behaviors."
    )


def test_an_answer_for_another_goal_ends_it(traveller, truth, fault):
    x, y, _ = place(truth)
    fault("navigation_answers_another")
    end = traveller.ended(traveller.go(x, y, 0.0))
    assert end.outcome == "answered_another"
    traveller.stands()
