"""Control by programs: REST requests become messages of the page's protocol, on a WebSocket per program.

So control, the dead-man, tasks and their records work as for pages. The pages process opens the WebSockets,
to the web process of the same web server.
"""
