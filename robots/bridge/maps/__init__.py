"""The robot's map: fetch, reduce and store it."""
