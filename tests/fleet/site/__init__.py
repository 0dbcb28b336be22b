"""Pages and addresses of the whole site: app, access, texts, probes, handshake."""
