"""Webhooks: signed events from the audit log. Housekeeping sends them to other programs (docs/webhooks.md).

`event_reader` turns records into deliveries, `delivery` sends them, `worker` runs both in threads; `views` are the
pages.
"""
