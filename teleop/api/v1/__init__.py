"""The REST API, version 1: thin views over the services that the pages use."""
