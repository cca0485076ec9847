"""The Pareto front: results that no other one beats in both respects."""

from __future__ import annotations

from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]], *, is_higher_better: bool) -> list[int]:
    """Indices of the points on the front, rising in x.

    A point is on it when no other is at least as good in both and better in one; equal points stand or fall together.

    Args:
        points: (x, y); x is a cost, less is better.
        is_higher_better: Direction of y.
    """
    sign = 1.0 if is_higher_better else -1.0
    front: list[int] = []
    best_y, best_x = float("-inf"), float("-inf")
    for index in sorted(range(len(points)), key=lambda i: (points[i][0], -sign * points[i][1], i)):
        x, y = points[index][0], sign * points[index][1]
        if y > best_y or (y == best_y and x == best_x):
            front.append(index)
            best_x, best_y = x, y
    return front
