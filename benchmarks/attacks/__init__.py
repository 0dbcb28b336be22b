"""script/soak attacks: floods from a robot's network and from strangers at the web door, while somebody drives.

Each attack has one home: `ros_side` (from the robot's network), `web_side` (at the web door), `incidents` (one blow
that ends or freezes a bridge). `catalogue` lists them, `scene` drives, presses the stop and watches, `figures` judges.
Everything is bounded in count and time and stays on loopback addresses.
"""
