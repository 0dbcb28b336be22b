"""The pages process, which answers pages and REST: the client in front of it, its keeper, its program."""
