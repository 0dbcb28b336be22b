"""The bucket of an S3-compatible store (boto3): what the console asks of it, and why it does not answer, in words.

boto3 is loaded at the first use: most processes never need it.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from fleet.base.environment import ObjectStore

CONNECT_S = 3.0
PICTURE = ".jpg"  # beside a recording

# Codes of S3, and what they mean here
_MEANINGS = {
    "NoSuchBucket": "it has no bucket {bucket}: make it, or correct FLEET_S3_URL",
    "InvalidAccessKeyId": "it does not know the key: correct FLEET_S3_KEY",
    "SignatureDoesNotMatch": "the secret does not belong to the key: correct FLEET_S3_SECRET",
    "AccessDenied": "the key may not read, write, list and delete in the bucket {bucket}: give it these rights",
    "AllAccessDisabled": "the bucket {bucket} is closed",
    "PermanentRedirect": "the bucket {bucket} is in another region: correct FLEET_S3_URL and FLEET_S3_REGION",
    "AuthorizationHeaderMalformed": "the bucket {bucket} is in another region: correct FLEET_S3_REGION",
    "RequestTimeTooSkewed": "its clock and the one of this computer differ: set the wrong one",
}
_ALIASES = {
    "InvalidRegion": "AuthorizationHeaderMalformed",
    "301": "PermanentRedirect",
    "403": "AccessDenied",
}
_MISSING = ("NoSuchKey", "404", "NotFound", "NoSuchUpload", "412", "PreconditionFailed")


class StoreAway(Exception):
    """The store does not do what it is asked. The text says why, and what to do."""

    silent = False  # it did not answer at all


class NotThere(StoreAway):
    """There is no such object, upload, or version of the object."""


class Found(NamedTuple):
    """An object."""

    bytes: int
    tag: str  # its ETag, with quotes


class Part(NamedTuple):
    """A part of an upload."""

    number: int  # from 1
    bytes: int
    tag: str


class Bucket:
    """One bucket. All methods raise `StoreAway`; they try once, and wait `patience_s` for each answer at most."""

    def __init__(self, store: ObjectStore, patience_s: float) -> None:
        self._store = store
        self._client = _client(store, patience_s)

    def check(self) -> None:
        """Ask for a list: the store tells exactly what is wrong, as it does not for a single object."""
        self._ask("list_objects_v2", Prefix=self._store.prefix, MaxKeys=1)

    # --- objects ----------------------------------------------------------------------------------------

    def keys(self, beginning: str) -> Iterator[str]:
        """Yield the keys of objects that begin like this."""
        after: dict[str, str] = {}
        while True:
            answer = self._ask("list_objects_v2", Prefix=beginning, **after)
            yield from (one["Key"] for one in answer.get("Contents", []))
            if not answer.get("IsTruncated"):
                return
            after = {"ContinuationToken": answer["NextContinuationToken"]}

    def find(self, key: str) -> Found:
        """Return what an object is. Raises `NotThere`."""
        answer = self._ask("head_object", Key=key)
        return Found(answer["ContentLength"], answer["ETag"])

    def read(self, key: str, begin: int = 0, count: int | None = None, tag: str = "") -> bytes:
        """Return `count` bytes, or all until the end, of this version of an object. Raises `NotThere`."""
        wanted = (
            {"Range": f"bytes={begin}-{'' if count is None else begin + count - 1}"} if begin or count else {}
        )
        if tag:
            wanted["IfMatch"] = tag
        data: bytes = self._ask("get_object", "Body", Key=key, **wanted)
        return data

    def put(self, key: str, data: bytes) -> None:
        """Make a small object."""
        self._ask("put_object", Key=key, Body=data, ContentMD5=_base64_md5(data))

    def remove(self, key: str) -> None:
        """Remove an object, if there is one."""
        self._ask("delete_object", Key=key)

    # --- uploads in parts -------------------------------------------------------------------------------

    def uploads(self, key: str) -> list[str]:
        """Return the ids of unfinished uploads of an object, the newest first."""
        found = self._ask("list_multipart_uploads", Prefix=key).get("Uploads", [])
        own = sorted((one["Initiated"], one["UploadId"]) for one in found if one["Key"] == key)
        return [number for _, number in reversed(own)]

    def begin(self, key: str) -> str:
        """Begin an upload; return its id."""
        number: str = self._ask("create_multipart_upload", Key=key)["UploadId"]
        return number

    def parts(self, key: str, upload: str) -> list[Part]:
        """Return the parts that the store has. Raises `NotThere`."""
        found: list[Part] = []
        after = 0
        while True:
            answer = self._ask("list_parts", Key=key, UploadId=upload, PartNumberMarker=after)
            found += [Part(one["PartNumber"], one["Size"], one["ETag"]) for one in answer.get("Parts", [])]
            if not answer.get("IsTruncated") or not answer.get("Parts"):
                return found
            after = answer["NextPartNumberMarker"]

    def send(self, key: str, upload: str, number: int, data: bytes) -> Part:
        """Send a part; the store refuses it if it was damaged on its way. Raises `NotThere`."""
        answer = self._ask(
            "upload_part",
            Key=key,
            UploadId=upload,
            PartNumber=number,
            Body=data,
            ContentMD5=_base64_md5(data),
        )
        return Part(number, len(data), answer["ETag"])

    def complete(self, key: str, upload: str, parts: list[Part]) -> None:
        """Make the object of its parts. Raises `NotThere`."""
        named = [{"PartNumber": part.number, "ETag": part.tag} for part in parts]
        self._ask("complete_multipart_upload", Key=key, UploadId=upload, MultipartUpload={"Parts": named})

    def abort(self, key: str, upload: str) -> None:
        """Forget an upload and its parts."""
        self._ask("abort_multipart_upload", Key=key, UploadId=upload)

    # --- inside -----------------------------------------------------------------------------------------

    def _ask(self, operation: str, content: str = "", **parameters: Any) -> Any:
        """Return the answer, or the bytes of its `content`."""
        from botocore.exceptions import BotoCoreError, ClientError, SSLError
        from urllib3.exceptions import HTTPError

        try:
            answer = getattr(self._client, operation)(Bucket=self._store.bucket, **parameters)
            return answer[content].read() if content else answer
        except ClientError as error:
            raise self._refused(error.response) from error
        except SSLError as error:
            raise self._away(
                f"its certificate is not trusted ({error}): name its authority in AWS_CA_BUNDLE"
            ) from error
        except (BotoCoreError, HTTPError, OSError) as error:
            away = self._away("it does not answer")
            away.silent = True
            raise away from error

    def _refused(self, response: dict[str, Any]) -> StoreAway:
        said = response.get("Error", {})
        status = response.get("ResponseMetadata", {}).get("HTTPStatusCode", "")
        code = said.get("Code", "") or str(status)
        code = _ALIASES.get(code, code)
        if meaning := _MEANINGS.get(code):
            return self._away(meaning.format(bucket=self._store.bucket))
        kind = NotThere if code in _MISSING else StoreAway
        return self._away(f"it answers {status} {code} {said.get('Message', '')}".strip(), kind)

    def _away(self, why: str, kind: type[StoreAway] = StoreAway) -> StoreAway:
        return kind(f"The object store {urlsplit(self._store.endpoint).netloc}: {why}.")


def key_of(prefix: str, path: Path) -> str:
    """Return the key of a file. Another content has another key: an upload never continues that of an earlier one."""
    return f"{prefix}{path.stem}.{path.stat().st_mtime_ns:x}{path.suffix}"


def name_of(key: str) -> str:
    """Return the name that the file had on the bridge's computer."""
    name = PurePosixPath(key)
    return f"{name.name.partition('.')[0]}{name.suffix}"


def family_of(key: str) -> str:
    """Return how the keys of all objects of the recording begin: earlier contents, and pictures."""
    folder, slash, name = key.rpartition("/")
    return f"{folder}{slash}{name.partition('.')[0]}."


def picture_of(key: str) -> str:
    """Return the key of the small picture of a recording."""
    return str(PurePosixPath(key).with_suffix(PICTURE))


def md5(data: bytes) -> bytes:
    """Return the digest that S3 uses against damage."""
    return hashlib.md5(data, usedforsecurity=False).digest()


def _base64_md5(data: bytes) -> str:
    return base64.b64encode(md5(data)).decode()


@cache
def _client(store: ObjectStore, patience_s: float) -> Any:
    """Return a client, which any thread may use."""
    import boto3
    from botocore.config import Config

    config = Config(
        connect_timeout=CONNECT_S,
        read_timeout=patience_s,
        retries={"total_max_attempts": 1, "mode": "standard"},
        max_pool_connections=20,
        # Names of buckets in the path, and no newer checksums: stores other than Amazon's know these
        s3={"addressing_style": "path"},
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
    )
    session = boto3.session.Session(
        aws_access_key_id=store.key, aws_secret_access_key=store.secret, region_name=store.region
    )
    return session.client("s3", endpoint_url=store.endpoint, config=config)
