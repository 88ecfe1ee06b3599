"""How the cells of a route's program hang together: weights of control points, sums, the field."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.routes.bspline import basis_rows
from trajopt.routes.cells import CELLS
from trajopt.routes.field import Field


class HasField(Protocol):
    """What holds the field of the scene that is solved in, and what was last ``seen`` of it: places
    (M, 2) and what is there (6, M)."""

    field: Field | None
    seen: tuple[Array, Array] | None


def cell_weights(points: int) -> Array:
    """(28, N): of the four control points of each cell: value, first and second derivative at its
    left end, the same at its right end, and the first in its middle."""
    count = CELLS * (points - 3)
    u = np.arange(count + 1) / CELLS
    hair = 1e-9  # the same to rounding, but of the cell's own segment
    pick = (np.arange(count) // CELLS)[:, None] + np.arange(4)
    parts = [basis_rows(points, at, k) for at in (u[:-1] + hair, u[1:] - hair) for k in (0, 1, 2)]
    parts.append(basis_rows(points, (u[:-1] + u[1:]) / 2, 1))
    return np.concatenate([np.take_along_axis(part, pick, axis=1).T for part in parts])


def summing(ca: Any, where: IndexArray, size: int) -> Any:
    """The matrix that sums values into places."""
    count = len(where)
    pattern = ca.Sparsity.triplet(size, count, where.tolist(), list(range(count)))
    return ca.DM(pattern, np.ones(count))


def field_call(ca: Any, holder: HasField, count: int) -> Any:
    """A CasADi function of places (2, M): distance and its five derivatives (6, M)."""

    class FieldCall(ca.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.construct("field", {})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:  # noqa: ARG002
            return ca.Sparsity.dense(2, count)

        def get_sparsity_out(self, i: int) -> Any:  # noqa: ARG002
            return ca.Sparsity.dense(6, count)

        def eval(self, arguments: Any) -> list[Any]:
            assert holder.field is not None
            places = np.asarray(arguments[0]).T
            if holder.seen is None or not np.array_equal(holder.seen[0], places):
                holder.seen = places.copy(), holder.field.smooth(places)
            return [holder.seen[1]]

    return FieldCall()
