"""The errors that stop a backup, its check or its way back. Each text is for the admin at the command line."""


class BackupError(Exception):
    """Something stops the work; the text says what."""


class WrongPassphrase(BackupError):
    """The passphrase is not the one of this archive."""

    def __init__(self) -> None:
        super().__init__("The passphrase is wrong.")


class Damaged(BackupError):
    """The archive was changed, is cut off, or is something else."""

    def __init__(self, what: str) -> None:
        super().__init__(f"The archive is damaged: {what}.")
