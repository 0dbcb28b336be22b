"""``python -m robots.simulator``: one simulated robot. The master, or the domain, is taken from the environment."""

from __future__ import annotations

import argparse
import logging
import math
from dataclasses import replace

from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.sensors.body import BODIES, REAR_CAMERA
from robots.simulator.sensors.odometry import Drift
from robots.simulator.worlds import World, load_world


def pose(text: str) -> Pose:
    """Parse ``X,Y,YAW`` in metres and degrees."""
    try:
        x, y, degrees = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,YAW in metres and degrees") from None
    return Pose(x, y, math.radians(degrees))


def world(name: str) -> World:
    """Load a world by its name or path."""
    try:
        return load_world(name)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="python -m robots.simulator", description=__doc__)
    parser.add_argument(
        "--world", type=world, default="office", help="name of a world, or path of a .yaml file"
    )
    parser.add_argument("--pose", type=pose, help="start: X,Y,YAW in metres and degrees")
    parser.add_argument("--name", default="tiago-1", help="of the robot; names the ROS node")
    parser.add_argument("--seed", type=int, default=0, help="of every random number")
    parser.add_argument("--base", choices=sorted(BODIES), default="tiago", help="kind of robot")
    parser.add_argument("--drift", type=float, default=1.0, help="odometry drift, 1 as on a good day, 0 none")
    parser.add_argument("--depth-encoding", choices=("32FC1", "16UC1"), default="32FC1")
    parser.add_argument("--rear-camera", action="store_true", help="add a camera that looks back")
    parser.add_argument(
        "--camera-clock", action="store_true", help="draw a code of the time into the head camera's pictures"
    )
    parser.add_argument(
        "--lost", action="store_true", help="it does not know where it is before its pose is set"
    )
    parser.add_argument("--ros", type=int, choices=(1, 2), default=1, help="version of the robot's ROS")
    parser.add_argument("--namespace", default="/", help="of the robot's nodes and topics, with ROS 2")
    parser.add_argument(
        "--later", action="store_true", help="with ROS 2: later software, with /say and stamps on velocities"
    )
    parser.add_argument("--exit-with-parent", action="store_true", help="exit when standard input ends")
    return parser.parse_args()


def main() -> None:
    """Build the robot, then run it as a ROS node."""
    asked = arguments()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s: %(message)s")
    for chatty in ("rospy", "xmlrpc", "OpenGL"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
    x, y, degrees = asked.world.starts[0] if asked.world.starts else (0.0, 0.0, 0.0)
    start = asked.pose or Pose(x, y, math.radians(degrees))
    body = BODIES[asked.base]
    if asked.rear_camera:
        body = replace(body, rear_camera=REAR_CAMERA)
    robot = Robot(asked.world, body, start, asked.seed, Drift().times(asked.drift))
    robot.localisation.waits = asked.lost

    # Imported here, so that --help and a wrong world need no ROS.
    from robots.simulator.node import CameraOptions

    cameras = CameraOptions(asked.depth_encoding, asked.camera_clock)
    if asked.ros == 2:
        from robots.simulator.ros2 import process as ros2

        ros2.run(robot, asked.name, cameras, asked.exit_with_parent, asked.namespace, later=asked.later)
    else:
        from robots.simulator.ros import process as ros1

        ros1.run(robot, asked.name, cameras, asked.exit_with_parent)


if __name__ == "__main__":
    main()
