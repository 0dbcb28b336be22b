"""The inspector: one robot's topics, services and parameters, shown to people by a separate process.

Decoding a robot's messages must not delay a command. So the bridge starts this process when a person looks
(`robots.bridge.topics.inspector_client`) and passes its answers on.
"""
