"""The fastest profile on a graded grid, checked inside every cell, with a bound on what is left.

A cell's rows hold at its ends by construction (``timing/reach.py``) and are checked at its quarters.
Where one is broken by much, the cell takes constant u; where by little, its rows are tightened; what
is left is removed by slowing the whole motion. Beside it stands a lower bound on the time of any
motion (``timing/relaxed.py``); cells where the two differ most are split until they are near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.timing.cells import Cells, Measure, Source, cells_of
from trajopt.timing.curved import Curved
from trajopt.timing.profile import Profile, between, excess
from trajopt.timing.stages import SD2_CAP
from trajopt.timing.track import Track

_ROUNDS = 5  # of tightening on one grid; chosen
_MUCH = 3e-4  # excess from which a cell takes constant u; chosen
_LITTLE = 2e-6  # excess that is left to slowing down; chosen
_LEFT = 2e-5  # excess after the first rounds for which further ones are not spent; chosen
_KEPT = 1e-9  # relative violation that counts as none
_TIGHTER = (0.0, 1e-4, 1e-3)  # off all rows, in turn, where slowing down does not help; chosen
LARGEST_SLOWDOWN = 1.001  # of time; chosen
_FALLS = (
    0.8  # of the gap that two refinements have to leave at most, or no further one is made; chosen
)
_SLOWED = 1 + 1e-4  # of time, that is not refined away where no gap is asked for; chosen
_MOST_CELLS = 40_000  # chosen
_REFINEMENTS = 8  # of the grid; chosen
_SAME = 1e-9  # relative difference of speeds that counts as equal
_SETTLED = 1e-6  # relative change of y that ends the tangents: the next is its square; chosen
_MOST_TANGENTS = 100  # chosen: 6 are usual
_SMALL = 1e-3  # of the largest y, chosen: below it, rounding counts more than what is gained
_STILL = 1e-6  # relative change of a guess that ends the search for a better one; chosen
_TOWARDS_REST = 0.5 ** np.arange(1, 13)  # of a cell; chosen: what is left is 1e-4 of its time
_FALL = 4.0  # most by which a guess of y falls at once: rows near rest allow a few times as much
_UNKNOWN = 1.0  # m^2/s^2, guess where only bent limits bound the motion; chosen
_CHORDS = 6  # rounds of chords, each with what the last left; chosen


class Stuck(Exception):
    """No motion on this grid; what forbids it is found elsewhere. ``unbounded``: no row bounds the
    speed."""

    def __init__(self, unbounded: bool = False) -> None:
        super().__init__("no motion on this grid")
        self.unbounded = unbounded


@dataclass(frozen=True, eq=False)
class Ask:
    """What is wanted: ends in s' (m/s), stops (spline parameters), and the largest gap or None."""

    track: Track
    limits: Sequence[Limit]
    start: float
    end: float
    stops: Array
    gap: float | None


@dataclass(frozen=True, eq=False)
class Found:
    """A profile on its cells, the factor on time that removed what was left, and the least time of
    any motion, s (None where it was not asked for)."""

    cells: Cells
    profile: Profile
    slowdown: float
    bound: float | None
    reason: str = ""  # why the gap is larger than was asked for

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.profile.seconds.sum())

    @property
    def gap(self) -> float:
        """How far the duration is from the bound at most, as a share of it."""
        return 1 - (self.bound or 0.0) / self.seconds


@dataclass(frozen=True, eq=False)
class _Solved:
    y: Array
    first: Array
    last: Array
    over: Array  # (N,) share of the rows' scale by which they are broken in each cell
    factor: Array  # (N,) on y, what removes that


def fastest(ask: Ask, source: Source, u: Array, jumps: Array) -> Found:
    """On the grid u (N+1,), refined as the gap or broken rows ask for. Raises Stuck,
    InfeasibleError."""
    measure = Measure.of(ask.track)
    u = _graded_at_rest(ask, u)
    best: Found | None = None
    gaps: list[float] = []
    for done in range(_REFINEMENTS + 1):
        loose = cells_of(ask.track, measure, u, source, jumps)
        try:
            cells = _settled(ask, loose, source)
            solved, worst, split = _kept(ask, cells)
        except Stuck:
            if best is None:
                raise
            break
        if worst <= LARGEST_SLOWDOWN**2:
            found, lost = _found(ask, source, loose, (cells, solved, worst))
            if best is None or found.seconds < best.seconds:
                best, kept = found, solved
            gaps.append(best.gap)
            if ask.gap is None:
                if best.slowdown <= _SLOWED:
                    return best
            elif gaps[-1] <= ask.gap:
                return best
            elif len(gaps) > 2 and gaps[-1] > _FALLS * gaps[-3]:
                break
            else:
                many = lost > 0.25 * ask.gap * found.seconds / len(cells.d)
                split = many | split if found.slowdown > 1 + ask.gap / 10 else many
        if done == _REFINEMENTS or len(u) > _MOST_CELLS or not split.any():
            break
        u = np.sort(np.concatenate([u, ((u[:-1] + u[1:]) / 2)[split]]))
    if best is not None:
        return replace(best, reason="" if ask.gap is None else _reason(best, kept, len(u)))
    at = int(np.argmax(solved.over))
    limit, place = broken(cells, solved, at)
    raise InfeasibleError(
        limit,
        place,
        "it is broken between gridpoints, however fine the grid: "
        "it jumps here, or falls to zero too fast to be followed",
    )


def _found(
    ask: Ask, source: Source, loose: Cells, solution: tuple[Cells, _Solved, float]
) -> tuple[Found, Array]:
    """The motion slowed as it must be, with its bound where one is wanted, and (N,) the time that
    each cell may lose against that, s. Raises InfeasibleError where it stands."""
    cells, solved, worst = solution
    slow = float(np.sqrt(worst))
    motion = solved.y, solved.first, solved.last
    profile = Profile(Measure.of(ask.track), cells.u, cells.d, *motion).slower(slow)
    if not np.isfinite(profile.seconds).all():
        raise _standing(cells, profile.seconds)
    found = Found(cells, profile, slow, None)
    if ask.gap is None:
        return found, np.zeros(len(cells.d))
    bound, least = _bound(ask, loose, source, profile)
    return replace(found, bound=bound), profile.seconds - least


def roughly(ask: Ask, source: Source, u: Array, jumps: Array) -> float:
    """Duration (s) of the fastest profile that keeps the rows at gridpoints u (N+1,). Raises
    Stuck."""
    from trajopt.timing import reach

    cells = _settled(ask, cells_of(ask.track, Measure.of(ask.track), u, source, jumps), source)
    profile = _pass(ask, cells, np.zeros(len(cells.places)), _from_rest(ask, cells))
    return float(reach.cell_times(cells.d, *profile).sum())


def _reason(best: Found, solved: _Solved, gridpoints: int) -> str:
    """Why the gap stays larger than was asked for: what costs most."""
    if best.slowdown > 1 + 1e-4:
        limit, place = broken(best.cells, solved, int(np.argmax(solved.over)))
        return (
            f"limit '{limit}' at s = {place:.4g} varies faster than {gridpoints} gridpoints show, and "
            f"the whole motion is slowed by {best.slowdown - 1:.2g} for it"
        )
    return f"with {gridpoints} gridpoints, which are as many as are spent, bound and motion differ"


def _kept(ask: Ask, cells: Cells) -> tuple[_Solved, float, BoolArray]:
    """A profile, the factor on y that makes it keep all rows (inf where none does), and the cells
    whose rows are broken most."""
    for tighter in _TIGHTER:
        solved = _solve(ask, cells, tighter)
        worst = max(1.0, float(solved.factor.max()))
        if np.isfinite(worst):
            if cells.table.c.min(initial=1.0) > 0:  # what rest keeps, slowing down keeps
                break
            y, first, last = (m / worst for m in (solved.y, solved.first, solved.last))
            left, _ = excess(cells, y, first, last)
            if left.max() <= _KEPT:
                break
            worst = np.inf
    over = solved.over > max(_LITTLE, 0.1 * float(solved.over.max()))
    return solved, worst, over


def _solve(ask: Ask, cells: Cells, tighter: float) -> _Solved:
    """Solved and re-solved with what the check between the gridpoints found."""
    tight = np.full(len(cells.places), tighter)
    constant = _from_rest(ask, cells)
    best: _Solved | None = None
    for done in range(_ROUNDS):
        try:
            y, u0, u1 = _pass(ask, cells, tight, constant)
        except Stuck as stuck:
            if best is None or stuck.unbounded:
                raise
            break
        over, factor = excess(cells, y, u0, u1)
        solved = _Solved(y, u0, u1, over, factor)
        if best is None or over.max() < best.over.max():
            best = solved
        if over.max() <= _LITTLE or (done >= 3 and over.max() <= _LEFT):
            break
        much = over > _MUCH
        widened = much.copy()
        widened[1:] |= much[:-1]
        widened[:-1] |= much[1:]
        little = (over > _LITTLE / 4) & ~(widened & ~constant)
        constant |= widened
        more, added = 1.1 * np.where(little, np.minimum(over, 0.02), 0.0), np.zeros(len(tight))
        np.maximum.at(added, cells.left, more)
        np.maximum.at(added, cells.right, more)
        tight = tight + added
    assert best is not None
    return best


def _pass(ask: Ask, cells: Cells, tight: Array, constant: BoolArray) -> tuple[Array, Array, Array]:
    """y (N+1,), u0 and u1 (N,) of the fastest profile with rows tightened by ``tight`` (P,).
    Cells that cannot have linear u become ``constant``. Raises Stuck."""
    from trajopt.timing import reach

    count, right = len(cells.d), cells.right
    c = cells.table.c
    if tight.any():
        c = np.subtract(c, tight[:, None], out=cells.spare)
    rows = cells.table.a, cells.table.b, c
    top, bottom, rests = _ceilings(cells, c, cells.cap * (1 - tight))
    node = _nodes(ask, cells, top)
    start, end = _ends(ask, cells)
    sets = np.empty((count + 1, 2))
    sets[-1] = _onto(end, 0.0, min(node[-1], top[right[-1]]), tight[right[-1]])
    failed = reach.backward(
        cells.d, cells.left, right, *rows, top, bottom, rests, node, constant, sets
    )
    if failed >= 0:
        raise Stuck
    first = _onto(start, sets[0, 0], sets[0, 1], tight[cells.left[0]])
    return _forward(cells, rows, top, constant, sets, first)


def _forward(
    cells: Cells,
    rows: tuple[Array, Array, Array],
    top: Array,
    constant: BoolArray,
    sets: Array,
    first: float,
) -> tuple[Array, Array, Array]:
    """The greedy profile inside the sets (N+1, 2). Raises Stuck where nothing bounds it."""
    from trajopt.timing import reach

    count = len(cells.d)
    y, u0, u1 = np.empty(count + 1), np.empty(count), np.empty(count)
    reach.forward(
        cells.d, cells.left, cells.right, cells.middle, *rows, top, constant, sets, first, y, u0, u1
    )
    if y.max() >= SD2_CAP * (1 - 1e-9):
        raise Stuck(unbounded=True)
    return y, u0, u1


def _ceilings(cells: Cells, c: Array, cap: Array) -> tuple[Array, Array, BoolArray]:
    """(P,) each: greatest and least y that the rows at solved places leave, and whether they leave
    rest. Raises Stuck."""
    from trajopt.timing import ranges

    top, bottom = np.full(len(cap), np.inf), np.zeros(len(cap))
    rests = np.empty(len(cap), dtype=np.bool_)
    table = cells.table
    if ranges.ceilings(cells.solved, table.a, table.b, c, cap, top, bottom, rests) >= 0:
        raise Stuck
    return top, bottom, rests


def _settled(ask: Ask, loose: Cells, source: Source) -> Cells:
    """Cells with rows of bent limits taken at the fastest profile (``timing/curved.py``), from cells
    with rows at rest. Raises Stuck."""
    if not isinstance(source, Curved):
        return loose
    none, straight = np.zeros(len(loose.places)), _from_rest(ask, loose)

    def tangent(y: Array) -> Cells:
        where = ask.track, Measure.of(ask.track), loose.spots, loose.table
        return replace(loose, table=source.tangent(*where, y))

    def drive(cells: Cells) -> Array:
        return between(cells, *_pass(ask, cells, none, straight.copy()))

    def driven_on(cells: Cells) -> Array:
        """As fast as rows allow from the start, whatever lies ahead."""
        top, _, _ = _ceilings(cells, cells.table.c, cells.cap)
        highest = np.minimum(_nodes(ask, cells, top), SD2_CAP / 2)
        sets = np.stack([np.zeros(len(highest)), highest], axis=1)
        rows = cells.table.a, cells.table.b, cells.table.c
        first = min(_ends(ask, cells)[0], highest[0])
        return between(cells, *_forward(cells, rows, top, straight, sets, first))

    try:
        y = drive(loose)
    except Stuck as stuck:
        if not stuck.unbounded:
            raise
        y = np.minimum(loose.cap, _UNKNOWN)
    highest, found = y, False
    for _ in range(_MOST_TANGENTS):
        cells, before = tangent(y), y
        try:
            y, found = drive(cells), True
        except Stuck:
            if found:
                break
            try:
                y = np.clip(driven_on(cells), before / _FALL, highest)
            except Stuck:
                y = before / _FALL
            if _near(y, before, _STILL):
                raise
        if found and _near(y, before, _SETTLED):
            break
    return tangent(y)


def _from_rest(ask: Ask, cells: Cells) -> BoolArray:
    """(N,): cells that take constant u from the first: next to rest where a limit (power) leaves any
    force there."""
    found = np.zeros(len(cells.d), dtype=np.bool_)
    if not any(getattr(limit, "free_at_rest", False) for limit in ask.limits):
        return found
    found[0], found[-1] = ask.start == 0, ask.end == 0
    for place in ask.stops:
        at = int(np.argmin(np.abs(cells.u - place)))
        found[max(at - 1, 0) : at + 1] = True
    return found


def _graded_at_rest(ask: Ask, u: Array) -> Array:
    """The grid with cells next to rest halved towards it, where a limit leaves any force there:
    speeds grow with the cube root of the way, or fall at once."""
    if not any(getattr(limit, "free_at_rest", False) for limit in ask.limits):
        return u
    rests = np.concatenate([u[[0, -1]][[ask.start == 0, ask.end == 0]], ask.stops])
    at = np.searchsorted(u, rests - 1e-12 * (u[-1] - u[0]))
    near = np.concatenate(
        [np.stack([u[at], u[np.clip(at + k, 0, len(u) - 1)]], 1) for k in (-1, 1)]
    )
    return np.unique(np.append(u, near[:, :1] + np.diff(near) * _TOWARDS_REST))


def _near(new: Array, old: Array, share: float) -> bool:
    return bool(np.all(np.abs(new - old) <= share * (new + _SMALL * new.max())))


def _ends(ask: Ask, cells: Cells) -> tuple[float, float]:
    """y at both ends."""
    g, _ = Measure.of(ask.track).stretch(cells.places[[0, -1]])
    return float((ask.start * g[0]) ** 2), float((ask.end * g[1]) ** 2)


def _onto(wanted: float, low: float, high: float, tight: float) -> float:
    """``wanted`` in [low, high], where rounding or tightening alone may have put it outside."""
    slack = (_SAME + 2 * tight) * max(abs(high), abs(low))
    if not low - slack <= wanted <= high + slack:
        raise Stuck
    return min(max(wanted, low), high)


def _nodes(ask: Ask, cells: Cells, top: Array) -> Array:
    """(N+1,): bounds on y at gridpoints, 0 at stops."""
    node = np.append(top[cells.left], top[cells.right[-1]])
    node[1:] = np.minimum(node[1:], top[cells.right])
    if len(ask.stops):
        near = np.abs(cells.u[:, None] - ask.stops).min(axis=1)
        node[near <= 1e-12 * (cells.u[-1] - cells.u[0])] = 0.0
    return node


def _bound(ask: Ask, cells: Cells, source: Source, profile: Profile) -> tuple[float, Array]:
    """Least time of any motion, s, and each cell's share of it; ``cells`` have rows of bent limits at
    rest."""
    high = np.minimum(cells.cap, SD2_CAP)
    if not isinstance(source, Curved):
        none = np.zeros((len(high), 0))
        total, seconds, _ = _relaxed(ask, cells, (none, none, none))
        return total, seconds
    low = between(cells, profile.y, profile.first, profile.last)
    where = ask.track, profile.measure, cells.spots
    roots = source.roots(*where, (low, np.maximum(high, low)))
    total, seconds, high = _relaxed(ask, cells, roots)
    for _ in range(_CHORDS):
        ends = low, np.maximum(high, low)
        table, roots = source.chord(*where, cells.table, ends), source.roots(*where, ends)
        before = total
        total, seconds, upper = _relaxed(ask, replace(cells, table=table), roots)
        high = np.minimum(high, upper)
        if total - before <= (ask.gap or 0.0) / 20 * total:
            break
    return total, seconds


def _relaxed(
    ask: Ask, cells: Cells, roots: tuple[Array, Array, Array]
) -> tuple[float, Array, Array]:
    """Least time of any motion that keeps the rows and ``roots`` (``Curved.roots``), s, each cell's
    share, and y (P,) that no motion exceeds."""
    from trajopt.timing import relaxed

    table = cells.table
    top, _, _ = _ceilings(cells, table.c, cells.cap)
    seconds, upper = np.empty(len(cells.d)), np.minimum(cells.cap, SD2_CAP)
    total = relaxed.lower_bound(
        cells.d,
        cells.left,
        cells.middle,
        cells.right,
        table.a,
        table.b,
        table.c,
        *roots,
        top,
        _nodes(ask, cells, top),
        *_ends(ask, cells),
        seconds,
        upper,
    )
    return float(total), seconds, upper


def _standing(cells: Cells, seconds: Array) -> InfeasibleError:
    """Where a cell takes for ever."""
    i = int(np.argmax(~np.isfinite(seconds)))
    j = int(
        cells.right[i] if cells.cap[cells.right[i]] < cells.cap[cells.left[i]] else cells.left[i]
    )
    name = cells.table.names[int(np.argmin(cells.table.bounds[:, j]))]
    reason = "the robot must stand still here; end the path at the stop, or split it there"
    return InfeasibleError(name, cells.s(j), reason)


def broken(cells: Cells, solved: _Solved, at: int) -> tuple[str, float]:
    """Limit and place (m) of what is broken most in a cell."""
    worst, name, place = -np.inf, cells.table.names[0], cells.s(int(cells.left[at]))
    for k in range(5):
        j = int(cells.right[at]) if k == 4 else int(cells.left[at]) + k
        u = solved.first[at] + k / 4 * (solved.last[at] - solved.first[at])
        y = solved.y[at] + k / 4 * cells.d[at] * (solved.first[at] + u)
        rows = cells.table.a[j] * u + cells.table.b[j] * y - cells.table.c[j]
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds = y / cells.table.bounds[:, j] - 1
        if len(rows) and rows.max() > worst:
            worst = float(rows.max())
            name, place = (
                cells.table.names[int(cells.table.owner[int(np.argmax(rows))])],
                cells.s(j),
            )
        if np.nanmax(bounds, initial=-np.inf) > worst:
            worst = float(np.nanmax(bounds))
            name, place = cells.table.names[int(np.nanargmax(bounds))], cells.s(j)
    return name, place
