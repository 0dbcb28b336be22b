"""The camera process: passes on or encodes pictures for web processes, only while somebody watches."""
