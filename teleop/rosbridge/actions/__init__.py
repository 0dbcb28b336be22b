"""Goals of actions, as tasks of the chain. `action_goals`: the family; `translation`: goals to tasks; `ends`: of tasks."""
