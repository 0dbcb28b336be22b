"""The safety gate: decides how much of a twist the robot may execute. Pure: numpy only.

Words of these modules, each with its section of docs/gate.md (0: the introduction):

* twist (0): the velocity of the base: vx forward, vy left, w turning. Candidate (6): a twist that is checked.
* share (2): the part of a twist that may be driven, from 0 to 1. The smaller twist has the same arc.
* hull (1): the outline of the robot with its arm, seen from above. Gap: the distance of a point from it.
* hull growth (3, 4): for a check, the hull is made larger by this, so the robot keeps this distance.
* margin: m_front (2) is kept along the path, m_lat (3) to the sides, m_hard (6) in the roll-out.
* creep (3): the lowest speed to which an obstacle beside the way slows the robot, v_creep.
* restrain (1 to 5): reduce a twist so that braking ends before contact, and close passing is slow.
* way (9): the path ahead of the robot. `Way` is its kind: forward, left, reverse, right, bend or turn.
* roll-out (6): the motion until the robot stands, computed ("played") pose by pose.
* certificate (6): a proof that no point can limit a twist. Corridors: boxes without obstacles, for it.
* mover (10): an obstacle that the laser sees move. Drift: the velocity of its points.
* layer (7): the memory of one kind of sensor: how long and how finely it keeps points.
* column (7, 8): one cell of a depth picture with an obstacle: its place, its lowest and highest height.
* blind range (7): the camera measures nothing nearer than this. Near side: an obstacle's part in this range.
"""
