"""Webhooks: signed news from the audit log, sent by the housekeeping process to programs elsewhere (docs/webhooks.md).

`news` turns records into deliveries, `delivery` sends them, `worker` runs both in threads; `views` are the pages.
"""
