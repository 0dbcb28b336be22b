"""What else a holder may do: the allow-list, the scopes of programs, the tasks that a lesson leaves."""
