"""A stop of somebody who says so in the head is answered from the head, whatever becomes of the body."""

import json

import pytest

MEGABYTE = 1024 * 1024
PATHS = [b"/stop-all/", b"/api/stop/?format=xml", b"/robots/x/stop", b"/api/robots/x/stop/"]


@pytest.fixture
def head(session_cookie, session_key):
    """The head of a POST."""

    def made(path, *lines):
        first = b"POST %s HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: application/json" % path
        cookie = f"Cookie: {session_cookie}={session_key}".encode()
        return b"\r\n".join([first, cookie, *lines, b"", b""])

    return made


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "declared",
    [
        b"Content-Length: %d" % (500 * MEGABYTE),
        b"Content-Length: 10",
        b"Transfer-Encoding: chunked",
    ],
)
def test_the_body_of_a_stop_is_not_waited_for(web, head, path, declared):
    """401 is the view's own answer: it is nobody's session. Nothing of the body is ever sent."""
    with web.connect() as stranger:
        stranger.settimeout(5.0)
        stranger.sendall(head(path, b"X-CSRFToken: x", declared, b"Expect: 100-continue"))
        answer = stranger.recv(65536)
    assert answer.split(b"\r\n")[0].split()[1] == b"401"
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["code"] == "signed_out"


def test_the_body_that_follows_is_no_request(web, head):
    """It would be one if the connection went on."""
    smuggled = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with web.connect() as stranger:
        length = b"Content-Length: %d" % len(smuggled)
        stranger.sendall(head(b"/stop-all/", b"X-CSRFToken: x", length) + smuggled)
        parts = []
        while part := stranger.recv(65536):
            parts.append(part)
    answer = b"".join(parts)
    assert answer.count(b"HTTP/1.1 ") == 1
    assert b"Connection: close" in answer


def test_a_stop_by_a_form_waits_for_the_token_in_its_body(web, head):
    with web.connect() as stranger:
        stranger.settimeout(0.5)
        stranger.sendall(head(b"/stop-all/", b"Content-Length: 10"))
        with pytest.raises(TimeoutError):
            stranger.recv(65536)
        stranger.settimeout(5.0)
        stranger.sendall(b"0123456789")
        assert b" 401 " in stranger.recv(65536)
