"""Goals of the robot's actions, as tasks of the chain. `translation`: from goals to tasks; `ends`: how tasks end."""
