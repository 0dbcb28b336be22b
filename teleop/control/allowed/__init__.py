"""Further rights of a holder: the allow-list, the scopes of programs, the tasks that a lesson leaves."""
