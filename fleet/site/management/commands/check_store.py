"""``manage.py check_store``: whether the object store takes recordings, and what to do if not."""

from __future__ import annotations

from typing import Any
from uuid import uuid4

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from robots.recordings.models import Place, Recording
from robots.recordings.s3.bucket import Bucket, StoreAway
from robots.recordings.s3.upload import forget

PATIENCE_S = 10.0


class Command(BaseCommand):
    help = (
        "Write, read, list and remove a small object in the object store of recordings; exit 1 if it cannot."
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
        except StoreAway as error:
            raise CommandError(str(error)) from error
        waiting = Recording.objects.filter(place=Place.DIRECTORY).count()
        stored = Recording.objects.filter(place=Place.S3).count()
        self.stdout.write(
            f"{store.endpoint} takes, gives and removes objects in {store.bucket}/{store.prefix}. "
            f"It has {stored} recordings; {waiting} are on the computers of bridges."
        )
