"""Goals of actions as tasks. `action_goals`: the family; `translation`: from goals to tasks; `ends`: how tasks end."""
