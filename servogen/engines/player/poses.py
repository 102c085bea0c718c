"""Any motion as poses, between which all servos move by the same law.

In: widths frame by frame. Out: `Encoded`, with as few bytes as the limit on its distance from them allows.

    frames   ────●───────────●────●●──────────●      the cheapest path over all frames at which steps could
    law          trapezoid     straight  (jump)      begin: its cost is bytes, and a law must
                                                     stay close to every servo's width
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from itertools import combinations, pairwise

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.player.arithmetic import ENTRIES, Whole, blended, weights
from servogen.engines.player.encoding import Encoded, Rows, WidthScale, row_table, scale_of, stride_of
from servogen.engines.player.laws import SHAPES, table_of
from servogen.engines.player.script import (
    MAX_BYTES,
    SILENT,
    STAY,
    STRAIGHT,
    ScriptStep,
    ordered,
    script,
    timing,
)
from servogen.motion.trajectory import Floats

LONGEST = 256
"""The maximum number of frames of a step."""

LAW_SETS = (
    (),
    ("quintic",),
    ("trapezoid",),
    ("accelerate", "decelerate"),
    ("trapezoid", "accelerate", "decelerate"),
)

NODES = 600
"""For longer motions, steps begin and end only where the motion changes, and at every few frames."""

CORNER = 0.1
"""A third difference above this (cycles) is a change of the motion."""

MISSED, REACHED = 0, 1
"""Whether the pose of a frame is the one that the servos have there."""

PROBES = (0.25, 0.5, 0.75)
STEP_BYTES = 2
ENOUGH = 96
"""The size in bytes below which no other laws are tried."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """Frames `first` up to `end` of the motion; the pose of `pose` at the end of them."""

    first: int
    end: int
    law: str
    pose: int


def poses_encoded(
    rows: Floats,
    marks: Sequence[int],
    loop_start: int,
    far: float,
    near: float,
    *,
    limited: bool = True,
    halves: bool = False,
) -> Encoded:
    """Return `rows` (frames, channels; NaN without pulses), with laws that deviate by up to `far` cycles.

    A step begins at each of `marks`. Poses within `near` steps of a row share it. Raises ResourceError if
    they are `limited` and do not fit the table, or the two of the `halves` of rows, and if they exceed that
    by far.
    """
    shape, marks = rows.shape, tuple(marks)
    found = _poses_encoded(rows.tobytes(), shape, marks, loop_start, far, near, limited, halves)
    if isinstance(found, ResourceError):
        raise found
    return found


@lru_cache(maxsize=64)  # a motion is encoded again for each size of the tables that is tried
def _poses_encoded(
    data: bytes,
    shape: tuple[int, int],
    marks: tuple[int, ...],
    loop_start: int,
    far: float,
    near: float,
    limited: bool,
    halves: bool,
) -> Encoded | ResourceError:
    rows = np.frombuffer(data, dtype=np.float64).reshape(shape)
    whole = np.vstack((rows, rows[loop_start]))
    scale = scale_of(rows[~np.isnan(rows).any(axis=1)])
    poses, moves = fewest(whole, far, near * float((1 << scale.shifts).max()))
    columns = rows.shape[1]
    stride = stride_of(poses, columns) if halves else columns
    if poses * stride > MAX_BYTES or moves >= MAX_BYTES:
        return ResourceError(
            "does-not-fit",
            f"the motion needs {poses} or more poses and {moves} or more moves between them: "
            f"the player's tables hold {MAX_BYTES // stride} and {MAX_BYTES - 1}",
        )
    parts = list(motion_parts(whole, marks, loop_start, far))
    best: Encoded | None = None
    refused: ResourceError | None = None
    for laws in LAW_SETS:
        pieces = [piece for part in parts for piece in part.pieces(laws)]
        try:
            candidate = _encoded(whole, pieces, loop_start, laws, scale, near, limited=limited, halves=halves)
        except ResourceError as error:
            refused = error
            continue
        if best is None or candidate.size < best.size:
            best = candidate
        if best.size < ENOUGH:
            break
    if best is None:
        assert refused is not None
        return refused
    return best


def fewest(rows: Floats, far: float, near: float) -> tuple[int, int]:
    """Return lower bounds of the numbers of different poses and of different moves, without a search.

    Poses within `2 * near` cycles of each other may share a row. Counting stops once no table could hold
    more.
    """
    begins = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]).any(axis=1)))
    poses_held, lengths = rows[begins], np.diff(np.append(begins, len(rows)))
    change = np.diff(poses_held, axis=0)
    before, after = change[:-1], change[1:]
    # A law neither reverses nor rests between two jumps: a step must end in such a run of frames.
    turns = ((before > 2 * far) & (after < -2 * far)) | ((before < -2 * far) & (after > 2 * far))
    jumps = np.abs(change).max(axis=1, initial=0) > 4 * far
    needed = turns.any(axis=1) | (jumps[:-1] & jumps[1:] & (lengths[1:-1] > 1))
    poses = poses_held[1:-1]
    # A repeated move may be in the script only once, but its first occurrence takes a byte.
    both = needed[:-1] & needed[1:]
    distance = 2 * (far + near)
    return (
        _far_apart(poses[needed], distance),
        _far_apart(np.hstack((poses[:-1], poses[1:]))[both], distance),
    )


def _far_apart(points: Floats, distance: float) -> int:
    """Return a number of points more than `distance` from one another, up to that of a full table."""
    chosen = points[:1]
    for point in points[1:]:
        if len(chosen) > MAX_BYTES:
            break
        if np.abs(chosen - point).max(axis=1).min() > distance:
            chosen = np.vstack((chosen, point))
    return len(chosen)


def reduce_to_moves(rows: Floats, far: float, laws: Sequence[str]) -> list[tuple[int, int, str]]:
    """Return `rows` (frames, channels) as the moves and stays that take the player the fewest bytes.

    Each is the frame whose pose it begins in, the one whose pose it ends in, and "stay", "straight" or one of
    `laws`, which deviate by up to `far` cycles. A stay ends where its pose does, perhaps before a jump.
    """
    best: list[_Piece] = []
    cost = np.inf
    part = _Part(rows, 0, len(rows) - 1, far)
    for count in range(len(laws) + 1):
        for some in combinations(laws, count):
            pieces = list(part.pieces(some)) if len(rows) > 1 else []
            stored = sum(STEP_BYTES + rows.shape[1] * (piece.law != "stay") for piece in pieces)
            if stored + ENTRIES * count < cost:
                best, cost = pieces, stored + ENTRIES * count
    return [(piece.first, piece.end, piece.law) for piece in best]


def motion_parts(
    rows: Floats, marks: Sequence[int], loop_start: int, far: float
) -> Iterator[_Part | _Silence]:
    """Return the parts of all frames except the last, which is the frame after them."""
    silent = np.asarray(np.isnan(rows).any(axis=1))
    frames = len(rows) - 1
    edges = (np.flatnonzero(silent[1:] != silent[:-1]) + 1).tolist()
    bounds = sorted({0, loop_start, *(edge for edge in (*marks, *edges) if edge < frames), frames})
    for first, end in pairwise(bounds):
        if silent[first]:
            yield _Silence(first, end)
        else:
            last = end - 1 if silent[end] else end
            yield _Part(np.vstack((rows[first:end], rows[last])), first, last, far)


@dataclass(frozen=True, slots=True)
class _Silence:
    """Frames without pulses, from `first` up to `end`."""

    first: int
    end: int

    def pieces(self, laws: Sequence[str]) -> Iterator[_Piece]:
        """Return them as pieces, whose law is no choice."""
        for begin in range(self.first, self.end, LONGEST):
            yield _Piece(begin, min(begin + LONGEST, self.end), "silent", self.end)


@dataclass(slots=True)
class _Part:
    """Frames with pulses, in which every frame may begin a step; the first is frame `offset` of the motion.

    The last row is the pose of frame `last`, which the part ends in.
    """

    rows: Floats
    offset: int
    last: int
    far: float
    _found: dict[tuple[str, int], Whole] = field(default_factory=dict)
    """By law and first frame, for the ends behind it: whether it reaches them, 1 or 0, or -1 if nobody asked.
    It is the same whatever other laws there are.
    """
    _still: dict[int, int] = field(default_factory=dict)

    def pieces(self, laws: Sequence[str]) -> Iterator[_Piece]:
        """Return the cheapest pieces; a node is a frame, and REACHED or MISSED."""
        frames = len(self.rows) - 1
        nodes = _nodes(self.rows, self.far)
        cost = np.full((frames + 1, 2), np.inf)
        cost[0, REACHED] = 0
        came: dict[tuple[int, int], tuple[tuple[int, int], str]] = {}
        # Steps only lead forward, so one pass over the nodes in order settles every cost.
        for index, first in enumerate(nodes.tolist()):
            ends = nodes[index + 1 :]
            ends = ends[: int(np.searchsorted(ends, first + LONGEST, side="right"))]
            for pose in (REACHED, MISSED):
                if np.isfinite(cost[first, pose]) and len(ends):
                    for end, at_end, law in self._steps(first, pose, ends, laws, cost):
                        came[end, at_end] = (first, pose), law
        # The next part starts from its own first pose, so a jump at the end is a straight step of one frame.
        goal = frames, REACHED
        pieces = []
        while goal[0]:
            before, law = came[goal]
            following = self.last if goal[0] == frames else self.offset + goal[0]
            pose = self.offset + before[0] if law == "stay" else following
            pieces.append(_Piece(self.offset + before[0], self.offset + goal[0], law, pose))
            goal = before
        yield from reversed(pieces)

    def _steps(
        self, first: int, pose: int, ends: Whole, laws: Sequence[str], cost: Floats
    ) -> Iterator[tuple[int, int, str]]:
        """Lower the cost of the nodes to which a step from this one is the cheapest so far, and yield them
        with its law.
        """
        frames_still = self._frames_still(first, ends)
        columns = self.rows.shape[1]
        price = cost[first, pose] + STEP_BYTES + (0 if pose == REACHED else columns)
        for end in ends[ends - first <= frames_still].tolist():
            # A step can continue from there only if the next frame has the same pose.
            at_end = REACHED if end - first < frames_still else MISSED
            if price < cost[end, at_end]:
                cost[end, at_end] = price
                yield end, at_end, "stay"
        # A law begins at a stored pose: where the pose of the frame was not reached, it can only stay.
        if pose == MISSED:
            return
        price += columns
        for law in ("straight", *laws):
            # Most ends have a step that is as cheap, from an earlier frame or by another law.
            ends = ends[price < cost[ends, REACHED]]
            if not len(ends):
                return
            for end in self._reached(first, ends, law):
                cost[end, REACHED] = price
                yield end, REACHED, law

    def _frames_still(self, first: int, ends: Whole) -> int:
        """Return for how many frames the servos stay where they are."""
        if first not in self._still:
            still = np.abs(self.rows[first : ends[-1] + 1] - self.rows[first]).max(axis=1) <= self.far
            self._still[first] = int(np.argmin(still)) if not still.all() else len(still)
        return self._still[first]

    def _reached(self, first: int, ends: Whole, law: str) -> list[int]:
        """Return those of `ends` that the law reaches."""
        if (law, first) not in self._found:
            self._found[law, first] = np.full(LONGEST + 1, -1)
        found = self._found[law, first]
        new = ends[found[ends - first] < 0]
        if len(new):
            found[new - first] = 0
            found[_possible(self.rows, first, new, law, self.far) - first] = 1
        reached: list[int] = ends[found[ends - first] == 1].tolist()
        return reached


def _possible(rows: Floats, first: int, ends: Whole, law: str, far: float) -> Whole:
    """Return those of `ends` that the law reaches within `far` of every row."""
    start = rows[first]
    for probe in PROBES:
        frames = ((ends - first) * probe).astype(np.int64)
        shares = _share(law, frames / (ends - first))[:, None]
        away = np.abs(rows[first + frames] - start - shares * (rows[ends] - start))
        ends = ends[away.max(axis=1, initial=0) <= far]
    reached = []
    for end in ends.tolist():
        away = rows[first : end + 1] - start - _shares(law, end - first)[:, None] * (rows[end] - start)
        if np.abs(away).max() <= far:
            reached.append(end)
    return np.array(reached, dtype=np.int64)


@cache
def _shares(law: str, frames: int) -> Floats:
    return _share(law, np.arange(frames + 1) / frames)


def _share(law: str, u: Floats) -> Floats:
    return u if law == "straight" else np.asarray(SHAPES[law](u))


def _nodes(rows: Floats, far: float) -> Whole:
    """Return the frames at which steps may begin and end, such that a path over all frames exists."""
    frames = len(rows) - 1
    if frames <= NODES:
        return np.arange(frames + 1)
    change = np.abs(np.diff(rows, 3, axis=0)).max(axis=1) > CORNER
    near = {0, frames}
    for away in range(4):
        near |= set(np.minimum(np.flatnonzero(change) + away, frames).tolist())
    distance = max(4, frames // NODES)
    # Where a straight step does not fit between two nodes, every frame is one: then some path exists
    # everywhere.
    for first in range(0, frames, distance):
        end = min(first + distance, frames)
        straight = rows[first] + _shares("straight", end - first)[:, None] * (rows[end] - rows[first])
        fits = np.abs(rows[first : end + 1] - straight).max() <= far
        near |= {first, end} if fits else set(range(first, end + 1))
    return np.array(sorted(near))


def _encoded(
    rows: Floats,
    pieces: Sequence[_Piece],
    loop_start: int,
    laws: Sequence[str],
    scale: WidthScale,
    near: float,
    *,
    limited: bool,
    halves: bool,
) -> Encoded:
    places = {law: number * ENTRIES for number, law in enumerate(laws)}
    places |= {"straight": STRAIGHT, "stay": STAY, "silent": SILENT}
    pose_rows = Rows(near)
    frames = len(rows) - 1

    def number(frame: int) -> int:
        pose = rows[frame]
        if np.isnan(pose).any():  # no pulses up to the end, or once more
            following = np.flatnonzero(~np.isnan(rows[frame:]).any(axis=1))
            pose = rows[frame + following[0]] if len(following) else rows[~np.isnan(rows).any(axis=1)][0]
        return pose_rows.number(scale.exact(pose))

    steps = [ScriptStep(number(0), timing(pieces[0].end - pieces[0].first, STRAIGHT))]
    steps += [
        ScriptStep(number(piece.pose), timing(piece.end - piece.first, places[piece.law])) for piece in pieces
    ]
    first = 1 + sum(piece.end <= loop_start for piece in pieces)
    if steps[first].timing.law not in (STAY, SILENT):
        # The loop begins in the same row each time, also where poses that are nearly equal are in two.
        steps[-1] = replace(steps[-1], row=steps[first - 1].row)
    lead, loop, kept_rows = ordered(steps[:first], steps[first:], pose_rows.kept)
    table = row_table(kept_rows, limited=limited, halves=halves)
    stride = stride_of(len(kept_rows), rows.shape[1])
    encoded_script = script(lead, loop, stride, legs=False, limited=limited)
    tables = b"".join(table_of(law) for law in laws)
    values, silent = played([*lead, *loop], kept_rows, tables)
    return Encoded(
        scale,
        table,
        tables,
        encoded_script,
        None,
        np.arange(frames),
        scale.widths(values),
        silent,
        loop_start,
        (*lead, *loop),
    )


def blends(steps: Sequence[ScriptStep], laws: bytes) -> Iterator[tuple[int, int, Whole]]:
    """Yield of each step but the first the rows that it blends, and the weight of the second one in each of
    its frames, in 256ths.
    """
    for before, step in pairwise(steps):
        time = np.array(step.timing.times(), dtype=np.int64)
        law = step.timing.law
        start = step.row if law in (STAY, SILENT) else before.row
        yield start, step.row, time if law >= SILENT else weights(list(laws[law : law + ENTRIES]), time)


def played(
    steps: Sequence[ScriptStep], rows: Sequence[Sequence[int]], laws: bytes
) -> tuple[Whole, np.ndarray]:
    """Return 256 times the values, frame by frame, as the chip computes them, and the frames without
    pulses.
    """
    table = np.array(rows, dtype=np.int64)
    values = [
        blended(table[start][None, :], table[end][None, :], weight[:, None])
        for start, end, weight in blends(steps, laws)
    ]
    silent = [np.full(step.timing.frames, step.timing.law == SILENT) for step in steps[1:]]
    return np.concatenate(values), np.concatenate(silent)
