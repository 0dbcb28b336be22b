"""Control by programs: REST requests become messages of the robot page's protocol, on a WebSocket of their own.

So control, the dead-man, tasks and their records are those of pages. The WebSockets live in the pages process, and
lead to the web process of the same web server.
"""
