"""What is computed once for an object."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass

from swingid.numerics.once import once

CALLS: list[object] = []


@dataclass(frozen=True)
class Scaled:
    factor: float

    @once
    def sum_of(self, numbers: list[float]) -> float:
        CALLS.append(numbers)
        return self.factor * sum(numbers)


@once
def difference(scaled: Scaled, name: str = "left") -> str:
    CALLS.append(name)
    return f"{name} {scaled.factor}"


def test_a_result_is_kept_for_the_same_objects_and_for_equal_texts() -> None:
    CALLS.clear()
    scaled, numbers = Scaled(2.0), [1.0, 2.0]
    assert scaled.sum_of(numbers) == scaled.sum_of(numbers) == 6.0
    assert scaled.sum_of([3.0]) == 6.0
    assert difference(scaled, "left") == difference(scaled, "".join(("le", "ft"))) == "left 2.0"
    assert difference(scaled) == difference(scaled, name="left") == "left 2.0"
    assert difference(Scaled(3.0), "left") == "left 3.0"
    assert len(CALLS) == 4


def test_a_copy_keeps_nothing_wrong() -> None:
    scaled, numbers = Scaled(2.0), [1.0, 2.0]
    scaled.sum_of(numbers)
    for other in (copy.deepcopy(scaled), pickle.loads(pickle.dumps(scaled))):
        numbers[:] = [5.0]
        assert other.sum_of(numbers) == 10.0
        assert other.sum_of([4.0]) == 8.0
        numbers[:] = [1.0, 2.0]
