"""The program of a hashing process: for each line with a text and a salt it prints the bcrypt hash.

It runs as a file, without the console's packages, and ends when its input ends. The texts are SHA-256 digests of
passwords, so no password leaves the process that reads it.
"""

import os
import sys

import bcrypt

NICENESS = 19  # lower than the pages: driving and stops go first


def main() -> None:
    """Answer line by line."""
    os.nice(NICENESS)
    for line in sys.stdin.buffer:
        text, salt = line.split()
        sys.stdout.buffer.write(bcrypt.hashpw(text, salt) + b"\n")
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
