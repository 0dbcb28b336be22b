"""A small kinematic world for tests of the gate: line segments, laser, sonars, a base with delay and limits.

It shares only the robot's profile with the gate: contact is the distance of the true hull to the true segments.
The base obeys a command after `delay_s`; 10 Hz scans and 20 Hz ticks add to this delay.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import LaserScan
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.gate.conftest import LASER

ORIGIN = Pose(0.0, 0.0, 0.0)
STEP_S = 0.01
TICK_STEPS = 5
SCAN_STEPS = 10
ODOMETRY_STEPS = 2
SONAR_STEPS = 20


def wall(x0, y0, x1, y1):
    return [(x0, y0, x1, y1)]


def leg(x, y, width=0.04):
    """A square table leg."""
    h = width / 2.0
    corners = [(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)]
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def doorway(x, width, thickness=0.1, y=0.0):
    """Two wall ends with an opening of `width` around (x, y), to be passed along x."""
    segments = []
    for sign in (1, -1):
        edge, far = y + sign * width / 2, y + sign * 3.0
        segments += wall(x, edge, x, far) + wall(x + thickness, edge, x + thickness, far)
        segments += wall(x, edge, x + thickness, edge)
    return segments


def moved(pose, v):
    """The pose after one step."""
    heading = pose.yaw + v.w * STEP_S / 2
    cos, sin = math.cos(heading), math.sin(heading)
    return Pose(
        pose.x + STEP_S * (cos * v.vx - sin * v.vy),
        pose.y + STEP_S * (sin * v.vx + cos * v.vy),
        pose.yaw + STEP_S * v.w,
    )


@dataclass
class World:
    """One robot among segments, simulated in steps of 10 ms."""

    profile: GateProfile
    segments: list
    seed: int = 0
    pose: Pose = ORIGIN
    half_view: float = math.radians(95)
    beams: int = 572
    delay_s: float = 0.1
    noise_m: float = 0.01
    sonar_cone: float = 0.5
    sonar_noise_m: float = 0.0
    lost_echoes: float = 0.0
    slip: float = 0.0  # share of the wheels' way lost by slip
    velocity: Velocity = STILL  # of the wheels
    steps: int = 0
    least_gap_m: float = math.inf

    def __post_init__(self):
        self.gate = Gate(self.profile)
        self.random = np.random.default_rng(self.seed)
        self.queue = deque([STILL] * round(self.delay_s / STEP_S))
        self.sent = STILL
        self._by_odometry = self.pose if self.slip else None
        self.heard = set()  # names of sonars with an echo
        # A parked robot measures the same again: pose, segments and result of the last measurement are kept.
        self._gap_at = None
        self._measured = {}  # by the sensor's mount
        self.put(self.segments)

    def put(self, segments):
        """Replace the segments."""
        self.ends = np.array(segments, dtype=float).reshape(-1, 2, 2)

    @property
    def odometry(self):
        """The pose by the wheels."""
        return self._by_odometry or self.pose

    @property
    def now_s(self):
        return 50.0 + self.steps * STEP_S

    def drive(self, asked, seconds):
        """Hold the stick; `asked` is a velocity or a function of the world. Returns the last verdict."""
        verdict = None
        for _ in range(round(seconds / STEP_S)):
            self.sense()
            if self.steps % TICK_STEPS == 0:
                stick = asked(self) if callable(asked) else asked
                verdict = self.gate.decide(stick, self.sent, self.now_s)
                self.sent = verdict.velocity
            self.move()
        return verdict

    def sense(self):
        stamp_s = self.now_s + 1.7e9
        if self.steps % ODOMETRY_STEPS == 0:
            self.gate.observe_odometry(stamp_s, self.now_s, self.odometry, self.velocity)
        if self.steps % SCAN_STEPS == 0:
            self._scan(stamp_s)
        if self.steps % SONAR_STEPS == 0:
            for name, mount in self.profile.sonar_poses.items():
                cone = np.linspace(-self.sonar_cone / 2, self.sonar_cone / 2, 21)
                nearest = float(self.rays(mount, cone).min())
                if nearest < 1.0:
                    self.heard.add(name)
                if self.lost_echoes and self.random.random() < self.lost_echoes:
                    nearest = math.inf
                elif self.sonar_noise_m:
                    nearest = max(nearest + self.random.normal(0.0, self.sonar_noise_m), 0.02)
                self.gate.observe_range(name, stamp_s, self.now_s, nearest, 1.0)

    def _scan(self, stamp_s):
        increment = 2 * self.half_view / (self.beams - 1)
        angles = -self.half_view + increment * np.arange(self.beams)
        ranges = self.rays(self.profile.scan_poses[LASER], angles)
        ranges += self.random.normal(0.0, self.noise_m, len(ranges))
        ranges[self.random.random(len(ranges)) < 0.01] = math.nan
        scan = LaserScan(LASER, stamp_s, self.now_s, ranges, -self.half_view, increment, 0.05, 25.0)
        self.gate.observe_scan(scan)

    def rays(self, mount, angles):
        """Distance to the nearest segment along each ray from a sensor on the robot."""
        pose, ends, before, ranges = self._measured.get(mount, (None, None, None, None))
        if pose != self.pose or ends is not self.ends or not np.array_equal(before, angles):
            ranges = self._cast(mount, angles)
            self._measured[mount] = self.pose, self.ends, angles, ranges
        return ranges.copy()

    def _cast(self, mount, angles):
        mx, my, myaw = mount
        cos, sin = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        origin = np.array([self.pose.x + cos * mx - sin * my, self.pose.y + sin * mx + cos * my])
        heading = self.pose.yaw + myaw + angles
        rays = np.stack((np.cos(heading), np.sin(heading)), axis=1)[:, None]
        start, along = self.ends[:, 0] - origin, self.ends[:, 1] - self.ends[:, 0]
        cross = rays[..., 0] * along[:, 1] - rays[..., 1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
            at = (start[:, 0] * rays[..., 1] - start[:, 1] * rays[..., 0]) / cross
        hit = (far > 0) & (at >= 0) & (at <= 1)
        return np.where(hit, far, math.inf).min(axis=1)

    def move(self):
        self.queue.append(self.sent)
        wanted, limits = self.queue.popleft(), self.profile.limits
        linear, angular = limits.linear_mps2 * STEP_S, limits.angular_radps2 * STEP_S
        v = Velocity(
            self.velocity.vx + min(max(wanted.vx - self.velocity.vx, -linear), linear),
            self.velocity.vy + min(max(wanted.vy - self.velocity.vy, -linear), linear),
            self.velocity.w + min(max(wanted.w - self.velocity.w, -angular), angular),
        )
        self.pose = moved(self.pose, v.scaled(1.0 - self.slip))
        self._by_odometry = self._by_odometry and moved(self._by_odometry, v)
        self.velocity = v
        self.steps += 1
        if self._gap_at is None or self._gap_at[0] != self.pose or self._gap_at[1] is not self.ends:
            self._gap_at = self.pose, self.ends
            self.least_gap_m = min(self.least_gap_m, self.true_gap())

    def true_gap(self):
        """Distance of the hull to the nearest segment; zero or less is contact."""
        cos, sin = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        shifted = self.ends - (self.pose.x, self.pose.y)
        local = np.stack(
            (cos * shifted[..., 0] + sin * shifted[..., 1], -sin * shifted[..., 0] + cos * shifted[..., 1]),
            -1,
        )
        start, along = local[:, 0], local[:, 1] - local[:, 0]
        if self.profile.outline is None:
            share = np.clip(-(start * along).sum(1) / (along**2).sum(1), 0, 1)[:, None]
            return float(np.hypot(*(start + share * along).T).min()) - self.profile.radius_m
        samples = start[:, None] + np.linspace(0, 1, 60)[None, :, None] * along[:, None]
        corners = np.array(self.profile.outline)
        sides = np.roll(corners, -1, 0) - corners
        normals = np.stack((sides[:, 1], -sides[:, 0]), 1) / np.hypot(*sides.T)[:, None]
        beyond = samples.reshape(-1, 2) @ normals.T - (normals * corners).sum(1)
        return float(beyond.max(axis=1).min())
