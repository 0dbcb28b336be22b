"""Alerts: when something needs somebody, staff are told by e-mail and webhook, and the page *Status* shows it."""
