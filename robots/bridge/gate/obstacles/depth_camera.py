"""The depth camera as two sources of obstacles: the newest picture, and the memory of earlier ones.

A point is kept in memory until a later picture sees through its place: the edge of a table leaves the picture
at the lower border long before the robot is there. Memory ages only while the robot moves, because only then
the odometry's error grows: a robot that stands at a table for minutes still remembers it.

The *feet* of an obstacle are its parts at the height of the lasers: legs of a person or a table. An obstacle
without feet *hangs*, such as the edge of a desk. If the feet are gone, the columns above them are gone, too,
unless they are connected with an obstacle that hangs.

The robot's own body and arm are left out.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.obstacles.near_side import NearSide
from robots.bridge.gate.obstacles.point_memory import (
    BRIEFLY_S,
    CELLS,
    DEPTH_LAYER,
    PASSES,
    Memory,
    moved_nearer,
    outside_robot,
)
from robots.bridge.gate.obstacles.sightings import (
    BEHIND_M,
    SAME_M,
    Past,
    beside,
    beyond,
    past,
    seen_free,
    sight_of_doubtful,
)
from robots.bridge.gate.sensing.depth import (
    Columns,
    Picture,
    Transform,
    came_since,
    check_shown,
    columns_of,
    is_one_thing,
    measured_to_m,
    seen_through,
    top_m,
)
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.timing.freshness import DEPTH_STALE_S, Freshness
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.bridge.gate.values import Kind, SensorHealth
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import (
    NO_POINTS,
    ORIGIN,
    Points,
    chosen,
    from_columns,
    joined,
    placed,
    relative_to,
    wrapped,
)
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import say

Flags = NDArray[np.bool_]

# A head that looks ahead sees table height at one or more of these distances.
TABLE_M = 0.7
AHEAD_M = (1.2, 1.6, 2.0, 2.5)
# Angle of half the robot's width at 1.2 m: with this margin to the edge, the whole path is in the picture.
EDGE_RAD = 0.24
# One of this many earlier pictures shows the place of a moving person free: a second ago the person was
# elsewhere.
LOOKS_BACK = 3
LOOK_EVERY_S = 0.33
CAME_M = 2.0  # from the robot: farther objects are seen often enough before they are near
FOOT_M = 0.1  # a cell of the grid of feet
NEAR_CELLS = 2  # cells this near to a hit count as near
FEET_CELLS = 128  # 12.8 m, twice as far as the memory reaches
PASSED_S = 2.0  # a walking person is remembered for this time, as in a laser's memory
MET_M = 0.03  # a beam that ends farther behind a column did not hit it
MISSES_COUNT = 3  # a beam that missed a column counts as this many beams that hit it
HANGS = 3  # a column hangs after this many sightings without feet; in fewer it may have moved since the scan
JOINED_M = 0.12  # nearer columns belong to one thing
NEAR_HULL_M = 0.4  # places farther from the hull will be seen when the robot comes nearer
LENS_AHEAD_M = 0.15  # distance of the lens from the axis about which the head turns
MIDDLE_RAD = 0.3  # a place at a smaller angle from the middle is in the picture anyway
MOVED_M = 0.005  # less motion counts as standing
MOVED_RAD = 0.01


class Frame(NamedTuple):
    """A picture with the camera's pose and its obstacle columns (base frame of the picture's stamp)."""

    picture: Picture
    to_base: Transform
    columns: Columns


def frame_of(picture: Picture, to_base: Transform, view: DepthView) -> Frame:
    """Compute the frame of a picture. Raises Malformed if the picture shows nothing.

    This is the costly part. It needs no odometry and may run on any thread.
    """
    check_shown(picture, to_base)
    return Frame(picture, to_base, columns_of(picture, to_base, top_m(to_base, view.height_m)))


class DepthCamera:
    """The newest picture's obstacles; `remembered` holds those of earlier pictures."""

    kind: Kind = "depth"
    name = "depth"
    word = "depth"

    def __init__(self, view: DepthView, footprint: Footprint) -> None:
        self.footprint = footprint
        self.own_outline = footprint  # with the parts of the arm outside the base: the camera sees them
        self.arm_reach: Disc | None = None  # points in here may be the arm and are not remembered
        self.freshness = Freshness()
        self.remembered = DepthMemory(self)
        self._view = view
        self._memory = Memory(DEPTH_LAYER)
        self._spans = _Spans(self._memory)
        self._frame: Frame | None = None
        self._shows_tables = False  # whether the newest picture shows table height ahead
        # How far its columns of pixels are measured at table height
        self._measured_m = np.empty(0, np.float32)
        self._seen = NO_POINTS  # odometry frame
        self._near_side = NearSide(view.blind_m)
        self._hidden = NO_POINTS  # possible obstacles in the blind range, odometry frame
        self._feet = _Feet()
        self._looks: deque[tuple[Frame, Pose]] = deque(maxlen=LOOKS_BACK)
        self._looked_s = -math.inf
        self._clock = _MotionClock()
        self._resets = 0
        self._is_doubtful = False  # a gap of the odometry came after the newest picture
        self.complaint = ""  # about the newest picture
        self._frames = 0
        self._scans = 0  # number of scans that changed which points are overruled
        # revision, points in the odometry frame, possible error of each
        self._unseen: tuple[int, Points, NDArray[np.float64]] = (-1, NO_POINTS, np.empty(0))
        self._shown = NO_POINTS, NO_POINTS, NO_POINTS  # seen, hidden, and both
        # Seen points, and their cells: computed once for each picture
        self._cells = (NO_POINTS, self._memory.entries(NO_POINTS))
        self._known: tuple[int, int, int, bool] = (0, 0, 0, False)
        self._revision = 0

    # --- input ----------------------------------------------------------------------------------

    def observe(self, frame: Frame, stamp_s: float, arrival_s: float, trail: Trail) -> None:
        """Take a picture; without a pose it is ignored."""
        self._forget_another_frame(trail)
        base = trail.pose_at(stamp_s) if math.isfinite(stamp_s) else None
        if base is None:
            self.complaint = say("its stamps do not match the odometry’s")
            return
        if not self.freshness.advances(stamp_s, arrival_s):
            return
        self.complaint = ""
        self._is_doubtful = False
        self._frame = frame
        self._shows_tables = _shows_tables(frame)
        self._measured_m = measured_to_m(frame.picture, frame.to_base, TABLE_M)
        self._frames += 1
        self._learn(frame, base, self._clock.pass_to(base, arrival_s), arrival_s)
        if stamp_s - self._looked_s >= LOOK_EVERY_S:
            self._looks.append((frame, base))
            self._looked_s = stamp_s

    def complain(self, why: str) -> None:
        """Take the reason why a picture cannot be used."""
        self.complaint = why

    @property
    def is_empty(self) -> bool:
        """Return whether nothing is remembered."""
        return self._memory.is_empty

    def doubt(self, doubt: Doubt, base: Pose) -> None:
        """Take a gap of the odometry; the robot is at `base` now. The newest picture counts as memory, too."""
        self._memory.doubt(doubt, base)
        self._is_doubtful = True

    def forget(self) -> None:
        """Forget earlier pictures; keep the newest one."""
        self._memory.clear()
        self._near_side.clear()

    def _learn(self, frame: Frame, base: Pose, moved_s: float, now_s: float) -> None:
        shown = self._without_robot(frame.columns)
        self._seen = placed(shown.points, base)
        kept = shown.only(self._cannot_be_arm(shown.points))
        places = placed(kept.points, base)
        self._memory.follow(base, moved_s)
        new = ~self._memory.knows(places)
        self._spans.note(places, kept, new)
        self._spans.note_feet(places, new, self._came(kept, new, base), self._feet)
        self._spans.note_time(places, new, now_s)
        self._memory.see(places, base, moved_s)
        self._memory.forget(self._spans.have_passed(self._memory.points(moved_s), now_s))
        remembered = self._memory.points(moved_s)
        from_base = placed(remembered, relative_to(ORIGIN, base))
        columns = self._spans.columns(remembered, from_base)
        self._memory.pass_through(all_seen_through(frame, columns, self._memory.doubts_m()))
        self._hidden = self._near_side.hidden(
            kept, frame.to_base, base, self._memory.points(moved_s), self.own_outline, moved_s
        )

    def _came(self, shown: Columns, new: Flags, base: Pose) -> Flags:
        """Return which of the `new` columns moved there: an earlier picture showed their place free."""
        came = np.zeros(len(new), dtype=np.bool_)
        asked = np.flatnonzero(new & (np.abs(shown.points).max(axis=1, initial=0.0) < CAME_M))
        for then, there in self._looks:
            asked = asked[~came[asked]]
            if not len(asked):
                break
            known = shown.only(asked)
            places = placed(placed(known.points, base), relative_to(ORIGIN, there))
            came[asked] = came_since(then.picture, then.to_base, known._replace(points=places))
        return came

    def observe_scan(self, sweep: Sweep, sensor: Pose, laser: int = 0) -> None:
        """Take a scan of a laser at `sensor` (odometry frame): forget obstacles whose feet are gone.

        Other lasers' results about places that this laser cannot see remain valid.
        """
        self._feet.see(sweep, sensor, laser)
        remembered = self._memory.points(self._clock.now_s)
        if not len(remembered):
            return
        free = self._spans.stands(remembered) & ~self._feet.near(remembered)
        below = np.flatnonzero(free)
        if len(below):
            x, y = placed(chosen(remembered, below), relative_to(ORIGIN, sensor)).T
            far = np.maximum(np.sqrt(x * x + y * y), FOOT_M)
            for aside_m in (-FOOT_M, 0.0, FOOT_M):
                beside = from_columns(x - y / far * aside_m, y + x / far * aside_m)
                free[below] &= seen_free(sweep, beside)
        met = np.flatnonzero(self._spans.is_met(remembered))
        from_sensor = placed(remembered, relative_to(ORIGIN, sensor))
        behind = past(sweep, from_sensor)
        judged = behind.likely > -SAME_M
        doubts_m = self._memory.doubts_m()
        if doubts_m.any():
            sighting = sight_of_doubtful(sweep, from_sensor, doubts_m)
            judged &= sighting.judged | (doubts_m == 0.0)
            free &= sighting.through | (doubts_m == 0.0)
        overruled = np.zeros(len(remembered), dtype=np.bool_)
        overruled[met] = judged[met]
        self._scans += self._spans.overrule(remembered, overruled, laser)
        free[met] |= (behind.surely[met] > MET_M) & (doubts_m[met] == 0.0)
        gone = self._spans.pass_below(remembered, free, judged)
        if gone.any():
            held = self._spans.hold_together(remembered, gone)
            held[met] = False
            self._memory.forget(gone & ~held)

    def _without_robot(self, columns: Columns) -> Columns:
        """Return the columns that are not inside the robot's body and a small margin: those are the robot."""
        if not len(columns.points):
            return columns
        return columns.only(self.own_outline.gaps(columns.points) >= self._view.own_m)

    def _cannot_be_arm(self, points: Points) -> NDArray[np.bool_]:
        """Return which points are out of reach of a moving or unknown arm; only these are remembered."""
        if self.arm_reach is None:
            return np.ones(len(points), dtype=np.bool_)
        x, y, reach_m = self.arm_reach
        far: NDArray[np.bool_] = np.hypot(points[:, 0] - x, points[:, 1] - y) > reach_m
        return far

    def _forget_another_frame(self, trail: Trail) -> None:
        """Forget everything after a jump of the odometry: remembered places are unknown."""
        if self._resets != trail.resets:
            self._resets = trail.resets
            self._memory.clear()
            self._looks.clear()
            self._looked_s = -math.inf
            self._feet.forget()
            self._near_side.clear()
            self._seen = self._hidden = NO_POINTS

    # --- state ----------------------------------------------------------------------------------

    def is_fresh(self, now_s: float) -> bool:
        """Return whether a usable picture came within half a second, and no gap of the odometry since."""
        return not self._is_doubtful and self.freshness.within(DEPTH_STALE_S, now_s)

    @property
    def sector(self) -> tuple[float, float] | None:
        """The direction (base frame) and half the width of the newest picture, rad; None: it shows no table height."""
        if self._frame is None or not self._shows_tables:
            return None
        to_base, right = self._frame.to_base, self._frame.picture.right
        heading = math.atan2(to_base[1, 2], to_base[0, 2])
        return heading, math.atan(min(-float(right[0]), float(right[-1])))

    @property
    def table_range_m(self) -> tuple[float, float]:
        """The distances from the lens (m, along the floor) between which table height is in the newest picture."""
        if self._frame is None:
            return math.inf, 0.0
        lowest, highest = _view_down(self._frame)
        drop = float(self._frame.to_base[2, 3]) - TABLE_M
        return (
            drop / math.tan(lowest) if 0.0 < lowest < math.pi / 2.0 else 0.0,
            drop / math.tan(highest) if highest > 0.0 else math.inf,
        )

    @property
    def lens(self) -> tuple[float, float]:
        """The place of the lens, base frame."""
        return (0.0, 0.0) if self._frame is None else tuple(self._frame.to_base[:2, 3].tolist())

    @property
    def columns(self) -> Points:
        """The places of the obstacles in the newest picture, base frame of its stamp."""
        return NO_POINTS if self._frame is None else self._frame.columns.points

    @property
    def measured(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The bearings of the newest picture's columns of pixels (base frame), and how far each is measured (m)."""
        if self._frame is None:
            return np.empty(0), np.empty(0)
        to_base, right = self._frame.to_base, self._frame.picture.right
        bearings = math.atan2(to_base[1, 2], to_base[0, 2]) - np.arctan(right)
        return bearings.astype(np.float64), self._measured_m.astype(np.float64)

    def sight_m(self, direction: float, curvature: float) -> float:
        """Return how much of the way is visible (m): infinite if all of it is, 0 if the camera looks elsewhere.

        The way begins in `direction` (base frame) and bends by `curvature` (1/m, left positive).
        """
        if (sector := self.sector) is None:
            return 0.0
        heading, half = sector[0], sector[1] - EDGE_RAD
        off = wrapped(direction - heading)
        if abs(off) > half:
            return 0.0
        # The chord to a place on an arc turns half as fast as the arc itself.
        room = half - math.copysign(1.0, curvature) * off
        return 2.0 * room / abs(curvature) if curvature else math.inf

    def turn_to(self, places: Points) -> float | None:
        """Return the camera's heading towards the nearest of these places (base frame); None if none is near.

        The lens moves on a circle when the head turns: the heading is computed from its middle.
        """
        if self._frame is None or not len(places):
            return None
        gaps = self.own_outline.gaps(places)
        near = np.flatnonzero((gaps < NEAR_HULL_M) & (places[:, 0] > 0.0))
        if not len(near):
            return None
        to_base = self._frame.to_base
        heading = math.atan2(to_base[1, 2], to_base[0, 2])
        x = to_base[0, 3] - LENS_AHEAD_M * math.cos(heading)
        y = to_base[1, 3] - LENS_AHEAD_M * math.sin(heading)
        nearest = places[near[gaps[near].argmin()]]
        turn = math.atan2(nearest[1] - y, nearest[0] - x)
        return turn if abs(turn) > MIDDLE_RAD else None

    def _revision_at(self, now_s: float) -> int:
        known = (self._frames, self._scans, self._memory.revision(self._clock.now_s), self.is_fresh(now_s))
        if known != self._known:
            self._known = known
            self._revision += 1
        return self._revision

    def places(self, trail: Trail, now_s: float) -> Points:
        self._forget_another_frame(trail)
        if trail.newest is None or not self.is_fresh(now_s):
            return NO_POINTS
        if self._shown[0] is not self._seen or self._shown[1] is not self._hidden:
            self._shown = self._seen, self._hidden, joined([self._seen, self._hidden])
        return self._shown[2]

    def moved_nearer(self, points: Points) -> Points:
        return points

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return self._seen if len(self.places(trail, now_s)) else NO_POINTS

    def near_sides(self, trail: Trail) -> Points:
        """Return places where an unseen near side may be, base frame of the newest odometry."""
        self._forget_another_frame(trail)
        return placed(self._hidden, relative_to(ORIGIN, trail.newest)) if trail.newest else NO_POINTS

    def unseen(self, trail: Trail, now_s: float) -> tuple[Points, NDArray[np.float64]]:
        """Return remembered points outside the newest picture, odometry frame, and the possible error of each."""
        self._forget_another_frame(trail)
        if trail.newest is None:
            return NO_POINTS, np.empty(0)
        revision = self._revision_at(now_s)
        if self._unseen[0] != revision:  # a new pose alone does not change it
            remembered = self._memory.points(self._clock.now_s)
            counts = ~self._spans.is_overruled(remembered)
            if self.is_fresh(now_s) and len(remembered):
                if self._cells[0] is not self._seen:
                    self._cells = self._seen, self._memory.entries(self._seen)
                counts &= ~self._spans.share_cells(remembered, self._cells[1])
            kept = counts.nonzero()[0]
            hidden = NO_POINTS if self.is_fresh(now_s) else self._hidden
            known, errors_m = joined([chosen(remembered, kept), hidden]), np.zeros(len(kept) + len(hidden))
            errors_m[: len(kept)] = self._memory.doubts_m().take(kept)
            hanging = self._spans.hangs(remembered).take(kept).nonzero()[0]
            errors_m[hanging] = self._memory.errors_m(kept.take(hanging))
            self._unseen = revision, known, errors_m
        return self._unseen[1:]

    def seen_before(self, trail: Trail, now_s: float) -> Points:
        """Return the points of `unseen` without the places that are only assumed to be occupied."""
        points, _ = self.unseen(trail, now_s)
        return points if self.is_fresh(now_s) else points[: len(points) - len(self._hidden)]

    def heights(self, points: Points) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest height (m) seen at points of this source, odometry frame."""
        return self._spans.heights(points)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        text = self.freshness.silence(DEPTH_STALE_S, now_s, self.complaint)
        return SensorHealth(self.name, "depth", not text, self.freshness.age_s(now_s), text)


class DepthMemory:
    """Depth memory as a separate source: points of earlier pictures."""

    kind: Kind = "depth memory"
    name = "depth, remembered"
    word = "depth, remembered"

    def __init__(self, camera: DepthCamera) -> None:
        self._camera = camera
        self._errors_m: NDArray[np.float64] = np.empty(0)

    def places(self, trail: Trail, now_s: float) -> Points:
        places, self._errors_m = self._camera.unseen(trail, now_s)
        return places

    def moved_nearer(self, points: Points) -> Points:
        return moved_nearer(points, self._errors_m, self._camera.footprint)

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return outside_robot(self._camera.seen_before(trail, now_s), trail.newest, self._camera.footprint)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        """Return the camera's state."""
        return self._camera.health(trail, now_s)._replace(name=self.name)


class _MotionClock:
    """A clock that counts only the time in which the robot moved, from one picture to the next."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._last: tuple[Pose, float] | None = None

    def pass_to(self, pose: Pose, now_s: float) -> float:
        """Move the robot to `pose`; return all counted seconds so far."""
        if self._last is None:
            self._last = pose, now_s
        there, since_s = self._last
        moved = relative_to(pose, there)
        if math.hypot(moved.x, moved.y) > MOVED_M or abs(moved.yaw) > MOVED_RAD:
            self.now_s += min(max(now_s - since_s, 0.0), DEPTH_STALE_S)
            self._last = pose, now_s
        return self.now_s


class _Feet:
    """Places near hits of the newest scans: a rolling grid of cells as wide as a foot."""

    def __init__(self) -> None:
        self._made: tuple[Flags, Flags] | None = None  # computed on demand from the newest scans
        self._scans: dict[int, tuple[Sweep, Pose]] = {}  # the newest of each laser

    def forget(self) -> None:
        self._scans.clear()
        self._made = None

    def see(self, sweep: Sweep, sensor: Pose, laser: int) -> None:
        """Take a scan of a laser at `sensor` (odometry frame)."""
        self._scans[laser], self._made = (sweep, sensor), None

    def near(self, points: Points) -> Flags:
        """Return whether a scan hit something within 0.2 to 0.3 m of these places."""
        near: Flags = self._grids[0][self._cells(points)]
        return near

    def past(self, points: Points) -> Past:
        """Return how far behind these places the beams end; of several lasers the farthest counts."""
        surely, likely = np.full((2, len(points)), -math.inf)
        for sweep, sensor in self._scans.values():
            one = past(sweep, placed(points, relative_to(ORIGIN, sensor)))
            surely, likely = np.maximum(surely, one.surely), np.maximum(likely, one.likely)
        return Past(surely, likely)

    def about(self, points: Points) -> Flags:
        """Return whether a scan hit something within 0.3 to 0.4 m: so far are a person's arms from the feet."""
        about: Flags = self._grids[1][self._cells(points)]
        return about

    @property
    def _grids(self) -> tuple[Flags, Flags]:
        """Cells near hits of the newest scans, and cells around those."""
        if self._made is None:
            near = np.zeros((FEET_CELLS, FEET_CELLS), dtype=np.bool_)
            for sweep, sensor in self._scans.values():
                near[self._cells(placed(sweep.points(), sensor))] = True
            for _ in range(NEAR_CELLS):
                near = _widened(near)
            self._made = near, _widened(near)
        return self._made

    def _cells(self, points: Points) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        x, y = points.T
        column, row = (np.floor(axis / FOOT_M).astype(np.intp) % FEET_CELLS for axis in (x, y))
        return column, row


def _widened(grid: Flags) -> Flags:
    """Return a rolling grid with all cells that touch a marked one."""
    for _ in range(2):  # along one axis, then along the other
        wide = grid.copy()
        wide[1:] |= grid[:-1]
        wide[:-1] |= grid[1:]
        wide[0] |= grid[-1]
        wide[-1] |= grid[0]
        grid = wide.T
    return grid


class _Spans:
    """For each cell of a memory: heights at which something was seen, times, and results of laser scans."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._low, self._high = np.zeros((2, CELLS * CELLS), dtype=np.float32)
        self._levels = np.zeros(CELLS * CELLS, dtype=np.uint16)
        # whether a laser saw feet below the column, and whether the column moved there
        self._footed, self._came = np.zeros((2, CELLS * CELLS), dtype=np.bool_)
        self._overruled = np.zeros(CELLS * CELLS, dtype=np.uint8)  # a bit for each laser
        # sightings without feet; beams that hit the column, less those that missed; scans in a row without feet
        self._hung, self._met, self._passes = np.zeros((3, CELLS * CELLS), dtype=np.int8)
        self._first_s, self._last_s = np.zeros((2, CELLS * CELLS))  # times of the first and last sighting
        self._marked = np.zeros(CELLS * CELLS, dtype=np.bool_)  # working memory of `share_cells`

    def note(self, points: Points, shown: Columns, new: Flags) -> None:
        """Note that these columns are seen at `points` (odometry frame); reset the cells of `new` ones."""
        entries = self._memory.entries(points)
        fresh = entries[new]
        self._low[fresh], self._high[fresh], self._levels[fresh] = np.inf, -np.inf, 0
        np.minimum.at(self._low, entries, shown.low)
        np.maximum.at(self._high, entries, shown.high)
        if shown.levels is not None:
            np.bitwise_or.at(self._levels, entries, shown.levels)

    def note_feet(self, points: Points, new: Flags, came: Flags, feet: _Feet) -> None:
        """Note whether the laser sees feet below these columns, and whether they moved there."""
        entries = self._memory.entries(points)
        fresh = entries[new]
        self._footed[fresh], self._came[fresh], self._hung[fresh], self._met[fresh] = False, False, 0, 0
        self._overruled[entries] = 0
        behind = feet.past(points)
        footed = feet.about(points)
        self._footed[entries] |= footed
        met = self._met[entries] + (behind.likely > -SAME_M) - MISSES_COUNT * (behind.surely > MET_M)
        self._met[entries] = np.clip(met, -HANGS, HANGS)
        hung = self._hung[entries] + (~footed & (behind.surely > BEHIND_M))
        self._hung[entries] = np.minimum(hung, HANGS)
        self._came[entries] |= came
        self._passes[entries] = 0

    def is_met(self, points: Points) -> Flags:
        """Return which remembered columns are tall, and hit by lasers where the camera saw them: walls, legs.

        For them the laser's place counts, because remembered places contain the odometry's error. Columns
        that are set back at the floor (a counter) or hang over their feet are not among them.
        """
        entries = self._memory.entries(points)
        met = np.flatnonzero(self._met[entries] > 0)
        is_met = np.zeros(len(points), dtype=np.bool_)
        there = chosen(points, met)
        is_met[met] = is_one_thing(self.columns(there, there), gaps=True)
        return is_met

    def note_time(self, points: Points, new: Flags, now_s: float) -> None:
        """Note the time at which these columns are seen."""
        entries = self._memory.entries(points)
        self._first_s[entries[new]] = now_s
        self._last_s[entries] = now_s

    def have_passed(self, points: Points, now_s: float) -> Flags:
        """Return which remembered columns moved there, stayed briefly, and have not been seen for a while."""
        entries = self._memory.entries(points)
        last_s = self._last_s[entries]
        briefly = last_s - self._first_s[entries] < BRIEFLY_S
        passed: Flags = self._came[entries] & briefly & (now_s - last_s > PASSED_S)
        return passed

    def stands(self, points: Points) -> Flags:
        """Return which remembered points have feet; for points that moved there one sighting is enough."""
        entries = self._memory.entries(points)
        stands: Flags = self._footed[entries] & (self._came[entries] | (self._hung[entries] < HANGS))
        return stands

    def hold_together(self, points: Points, gone: Flags) -> Flags:
        """Return which of the `gone` columns are connected with columns without feet: they hang as well.

        So the edge of a desk is kept when a person in front of it leaves.
        """
        entries = self._memory.entries(points)
        left = np.flatnonzero(gone & ~self._came[entries])
        hung = self._hung[entries]
        hanging = np.flatnonzero(((hung == HANGS) | (~self._footed[entries] & (hung == 0))) & ~gone)
        held = np.zeros(len(points), dtype=np.bool_)
        while len(left) and len(hanging):
            apart = chosen(points, left)[:, None] - chosen(points, hanging)
            joined = (np.abs(apart).max(axis=2) < JOINED_M).any(axis=1)
            hanging, left = left[joined], left[~joined]
            held[hanging] = True
        self._hung[entries[held]] = HANGS
        return held

    def hangs(self, points: Points) -> Flags:
        """Return which remembered columns hang: lasers see nothing below them and cannot correct them."""
        hangs: Flags = self._hung.take(self._memory.entries(points)) == HANGS
        return hangs

    def overrule(self, points: Points, overruled: Flags, laser: int) -> bool:
        """Note which remembered points a scan overrules; return whether this changed."""
        entries = self._memory.entries(points)
        before, bit = self._overruled[entries], np.uint8(1 << laser % 8)
        after = np.where(overruled, before | bit, before & ~bit)
        self._overruled[entries] = after
        return bool((before != after).any())

    def is_overruled(self, points: Points) -> Flags:
        """Return which of these remembered points the newest scan of a laser overrules."""
        overruled: Flags = self._overruled.take(self._memory.entries(points)) > 0
        return overruled

    def pass_below(self, points: Points, free: Flags, judged: Flags) -> Flags:
        """Note one scan, which can judge the points `judged`; `free` have no feet. Return which are gone."""
        entries = self._memory.entries(points)
        passes = self._passes[entries]
        self._passes[entries] = np.where(free, passes + 1, np.where(judged, 0, passes))
        gone: Flags = self._passes[entries] >= PASSES
        return gone

    def columns(self, points: Points, from_base: Points) -> Columns:
        """Return the columns of these remembered points, at `from_base` (base frame)."""
        entries = self._memory.entries(points)
        return Columns(from_base, self._low[entries], self._high[entries], self._levels[entries])

    def heights(self, points: Points) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest height at which something was seen at these points, metres."""
        entries = self._memory.entries(points)
        return self._low[entries], self._high[entries]

    def share_cells(self, points: Points, theirs: NDArray[np.intp]) -> Flags:
        """Return which of `points` lie in one of these cells."""
        self._marked[theirs] = True
        shared: Flags = self._marked.take(self._memory.entries(points))
        self._marked[theirs] = False
        return shared


def all_seen_through(frame: Frame, columns: Columns, doubts_m: NDArray[np.float64]) -> Flags:
    """Return which columns (base frame) a picture sees through, wherever they are within their possible errors."""
    gone = seen_through(frame.picture, frame.to_base, columns)
    rows = np.flatnonzero(gone & (doubts_m > 0.0))
    if not len(rows):
        return gone
    doubtful, doubts_m = columns.only(rows), doubts_m[rows]
    for points in (*beside(doubtful.points, doubts_m), beyond(doubtful.points, doubts_m)):
        gone[rows] &= seen_through(frame.picture, frame.to_base, doubtful._replace(points=points))
    return gone


def _view_down(frame: Frame) -> tuple[float, float]:
    """Return the lowest and the highest direction in the picture's middle column: radians below the horizon."""
    to_base, down = frame.to_base, frame.picture.down
    tilt = math.atan2(-to_base[2, 2], math.hypot(to_base[0, 2], to_base[1, 2]))
    return tilt + math.atan(float(down[-1])), tilt + math.atan(float(down[0]))


def _shows_tables(frame: Frame) -> bool:
    """Return whether the picture's middle column shows table height at one of the distances `AHEAD_M`."""
    to_base = frame.to_base
    if math.hypot(to_base[0, 2], to_base[1, 2]) < 1e-3:  # the camera looks straight down or up
        return False
    drop = float(to_base[2, 3]) - TABLE_M
    lowest, highest = _view_down(frame)
    out = math.hypot(float(to_base[0, 3]), float(to_base[1, 3]))
    return any(highest < math.atan2(drop, far - out) < lowest for far in AHEAD_M)
