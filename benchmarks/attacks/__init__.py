"""script/soak attacks: floods from a robot's network and from strangers at the web port, while somebody drives.

Modules of attacks: `ros_side` (from the robot's network), `web_side` (at the web port), `stop_side` (stops of others at
the web port; `people` makes their accounts), `incidents` (events that end or freeze a bridge). `catalogue` lists them,
`scene` drives, presses the stop and observes, `figures` checks limits.
All attacks are limited in count and time and use only loopback addresses.
"""
