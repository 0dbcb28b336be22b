"""``manage.py check_store``: whether the object store takes recordings, and what to do if not.

It also finds objects that belong to no recording. Only a person can tell whether they are those of another console, or
of the time after a backup that was restored; so `--remove` is needed to remove them.
"""

from __future__ import annotations

from typing import Any
from uuid import UUID, uuid4

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError, CommandParser

from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import Bucket, StoreAway, name_of
from robots.recordings.s3.upload import forget

PATIENCE_S = 10.0


class Command(BaseCommand):
    help = (
        "Write, read, list and remove a small object in the object store of recordings; exit 1 if it cannot."
    )

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument(
            "--remove", action="store_true", help="remove the objects that belong to no recording"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        store = settings.FLEET_S3
        if store is None:
            raise CommandError("FLEET_S3_URL is not set: recordings stay on the computers of the bridges.")
        bucket, key, data = Bucket(store, PATIENCE_S), f"{store.prefix}check-{uuid4()}.txt", b"fleet console"
        try:
            bucket.check()
            upload = bucket.begin(key)
            bucket.complete(key, upload, [bucket.send(key, upload, 1, data)])
            if bucket.read(key) != data:
                raise CommandError("The object store returned other bytes than it was given.")
            forget(bucket, key)
            strange = [key for key in bucket.keys(store.prefix) if _is_strange(key)]
            if options["remove"]:
                for key in strange:
                    bucket.remove(key)
        except StoreAway as error:
            raise CommandError(str(error)) from error
        waiting = Recording.objects.filter(place=Place.DIRECTORY).count()
        stored = Recording.objects.filter(place=Place.S3).count()
        self.stdout.write(
            f"{store.endpoint} takes, gives and removes objects in {store.bucket}/{store.prefix}. "
            f"It has {stored} recordings; {waiting} are on the computers of bridges."
        )
        if strange:
            what = "They are removed." if options["remove"] else "--remove removes them."
            self.stdout.write(f"Objects that belong to no recording: {len(strange)}. {what}")


def _is_strange(key: str) -> bool:
    """Return whether it is an object of a recorder, and no recording has it."""
    try:
        number = UUID(name_of(key).rpartition(".")[0][-36:])
    except ValueError:  # something else that lies there
        return False
    return not Recording.objects.filter(pk=number).exclude(object="").exists()
