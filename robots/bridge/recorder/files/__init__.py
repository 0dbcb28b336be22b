"""The files of recordings on the bridge's computer: written, finished after a crash, kept and removed."""
