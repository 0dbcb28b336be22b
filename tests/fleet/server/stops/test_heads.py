"""A stop with all data in its head is answered without its body."""

import json

import pytest

MEGABYTE = 1024 * 1024
PATHS = [b"/stop-all/", b"/api/v1/stop/?format=xml", b"/robots/x/stop", b"/api/v1/robots/x/stop/"]


@pytest.fixture
def head(session_cookie, session_key):
    """Build the head of a POST."""

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
    """The view answers 401, since nobody owns this session. The body is never sent."""
    with web.connect() as stranger:
        stranger.settimeout(5.0)
        stranger.sendall(head(path, b"X-CSRFToken: x", declared, b"Expect: 100-continue"))
        answer = stranger.recv(65536)
    assert answer.split(b"\r\n")[0].split()[1] == b"401"
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["code"] == "signed_out"


def test_the_body_that_follows_is_no_request(web, head):
    """If the connection stayed open, the server would read the body as a request."""
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


LONG = b"X-Long: " + b"x" * 20_000


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "lines",
    [
        [b"Content-Length: ten"],
        [b"Content-Length: -1"],
        [b"Content-Length: 1", b"Content-Length: 2"],
        [b"Content-Length: 1", b"Transfer-Encoding: chunked"],
        [b"Transfer-Encoding: gzip"],
        [b"a line without a colon"],
        [b": no name"],
        [b"X-Zero: \0"],
        [LONG],
        [b"X-%d: x" % number for number in range(150)],
    ],
    ids=lambda lines: lines[0].decode()[:30],
)
def test_a_stop_is_not_refused_for_its_head(web, head, path, lines):
    """The view answers 401. The bytes after the head are not read as a request."""
    received = web.say(
        head(path, b"X-CSRFToken: x", *lines) + b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    )
    assert received.count(b"HTTP/1.1 ") == 1
    assert json.loads(received.partition(b"\r\n\r\n")[2])["code"] == "signed_out"


def test_a_stop_with_a_line_that_does_not_end_is_a_stop(web, head):
    whole = head(b"/api/v1/stop/", b"X-CSRFToken: x", LONG)
    assert b"signed_out" in web.say(whole.removesuffix(b"\r\n\r\n"))


def test_the_query_of_a_stop_may_be_long(web, head):
    assert b"signed_out" in web.say(
        head(b"/api/v1/stop/?format=" + b"x" * 8000, b"X-CSRFToken: x", b"Connection: close")
    )


@pytest.mark.parametrize("line", [b"Content-Length: ten", LONG, b"a line without a colon"])
def test_other_requests_are_refused_for_their_head(web, head, line):
    code = b"headers_too_large" if line is LONG else b"malformed"
    assert code in web.say(head(b"/api/v1/robots", b"X-CSRFToken: x", line))
    if line is LONG:  # the token of the form is in the body, which is missing
        assert code in web.say(head(b"/stop-all/", line))
