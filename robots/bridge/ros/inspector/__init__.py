"""The inspector: one robot's topics, services and parameters, shown to people by a separate process.

Decoding whatever a robot publishes must not delay a command; so the bridge starts this process when somebody looks
(`robots.bridge.topics.inspector_client`) and hands its answers on.
"""
