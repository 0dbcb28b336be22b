"""Webhooks: signed events from the audit log; housekeeping sends them to programs elsewhere (docs/webhooks.md).

`event_reader` turns records into deliveries, `delivery` sends them, `worker` runs both in threads; `views` are the
pages.
"""
