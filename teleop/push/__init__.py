"""Web Push: a person's notifications on the devices that they chose, also while no page is open.

`services` keeps the devices and queues what is written for them; `delivery` sends it, `worker` in threads of
housekeeping. `encryption` and `keys` are RFC 8291 and RFC 8292: only the browser can read a push, and only this
console can send one. Devices' addresses are chosen by their persons: `address` lets no request into the own network.
"""
