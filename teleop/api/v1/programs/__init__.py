"""Control by programs: REST requests become messages of the robot page's protocol, on a WebSocket of their own.

So control, the dead-man, tasks and their records are the page's. The WebSockets live in the process that answers REST,
and lead to the process of the same web server that drives.
"""
