"""The services of rosapi, answered from what the inspector knows of the robot. `answers`: their list; `typedefs`."""
