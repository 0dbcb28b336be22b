"""The real server limits what strangers send before Django sees it."""

import http.client
import json
import re

import msgspec
import pytest

from fleet.server import limits
from teleop.api.v1.framework.problems import ProblemDetails
from tests.fleet.server.conftest import heard
from tests.processes import REPOSITORY

MEGABYTE = 1024 * 1024
HEAD = b"POST /accounts/sign-in/ HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def parsed(answer):
    """Return the status and the refusal of an answer."""
    head, body = answer.split(b"\r\n\r\n", 1)
    return int(head.split()[1]), json.loads(body)


@pytest.mark.parametrize(
    "path", [b"/", b"/accounts/sign-in/", b"/api/v1/robots", b"/robots/x/stop/", b"/nowhere"]
)
def test_a_huge_body_is_refused_before_it_is_sent(web, path):
    declared = b"POST %s HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % (path, 500 * MEGABYTE)
    status, refusal = parsed(web.say(declared))
    assert (status, refusal["code"]) == (413, "body_too_large")
    assert refusal["title"] and (refusal["status"], refusal["detail"]) == (413, refusal["text"])
    assert refusal["figures"] == {"most_bytes": limits.BODY_BYTES}
    key = "Not done: the request's body is larger than {most} bytes."
    assert refusal["said"]["detail"] == [key, {"most": limits.BODY_BYTES}]


def test_a_body_in_chunks_is_read_up_to_its_limit_and_no_further(web):
    before = web.resident_bytes()
    chunk = b"10000\r\n" + bytes(0x10000) + b"\r\n"
    sent = 0
    with web.connect() as stranger:
        stranger.sendall(HEAD + b"Transfer-Encoding: chunked\r\n\r\n")
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            while sent < 200 * MEGABYTE:
                stranger.sendall(chunk)
                sent += len(chunk)
    assert sent < 20 * MEGABYTE  # fits into the kernel's buffers
    assert web.resident_bytes() - before < 20 * MEGABYTE


def test_a_session_cookie_allows_an_admin_form_but_not_more(web, session_cookie):
    cookie = b"Cookie: %s=x\r\n" % session_cookie.encode()
    head = HEAD + cookie + b"Connection: close\r\nContent-Length: %d\r\n\r\n"
    assert b" 403 " in web.say(head % MEGABYTE + bytes(MEGABYTE))  # Django's answer: no CSRF token
    assert parsed(web.say(head % (500 * MEGABYTE)))[0] == 413


def test_a_long_address_and_large_headers_are_refused(web):
    status, refusal = parsed(web.say(b"GET /" + b"a" * 20000 + b" HTTP/1.1\r\n\r\n"))
    assert (status, refusal["code"]) == (414, "url_too_long")
    many = b"".join(b"X-%d: y\r\n" % number for number in range(limits.HEADERS + 2))
    for headers in (many, b"X: " + b"y" * 20000 + b"\r\n", b"X: " + b"y" * 100000):
        status, refusal = parsed(web.say(b"GET / HTTP/1.1\r\n" + headers))
        assert (status, refusal["code"]) == (431, "headers_too_large")


@pytest.mark.parametrize("method", [b"GET", b"POST", b"DELETE"])
@pytest.mark.parametrize("hosts", [[b"127.0.0.1", b"127.0.0.1"], [b"127.0.0.1", b"evil.example"]])
def test_a_request_with_two_hosts_is_malformed(web, method, hosts):
    lines = [b"Host: %s\r\n" % host for host in hosts]
    request = method + b" /api/v1/robots HTTP/1.1\r\n" + b"".join(lines)
    status, refusal = parsed(web.say(request + b"Connection: close\r\n\r\n"))
    assert (status, refusal["code"], refusal["rule"]) == (400, "malformed", "limits")


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"GET /api/v1/robots HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99999\r\n\r\n",
        b"POST /api/v1/bookings HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99999\r\n\r\n",
        b"GET /api/v1/robots?" + b"a" * 5000 + b" HTTP/1.1\r\n\r\n",
        b"GET /api/v1/robots HTTP/1.1\r\nX: " + b"y" * 20000 + b"\r\n\r\n",
        b"GET /api/v1/robots HTTP/1.1\r\nno colon\r\n\r\n",
    ],
    ids=["413", "413 of a change", "414", "431", "400"],
)
def test_the_schema_knows_each_refusal_of_the_door(web, request_bytes):
    status, refusal = parsed(web.say(request_bytes))
    details = msgspec.convert(refusal, ProblemDetails)
    schema = json.loads((REPOSITORY / "docs" / "openapi.json").read_text())
    method, path = request_bytes.split()[:2]
    answers = schema["paths"][path.decode().partition("?")[0]][method.decode().lower()]["responses"]
    assert str(status) in answers
    assert details.rule in schema["components"]["schemas"]["ProblemDetails"]["properties"]["rule"]["enum"]


def test_no_http_is_refused_in_words(web):
    status, refusal = parsed(web.say(b"\x16\x03\x01 no http at all\r\n\r\n"))
    assert (status, refusal["code"]) == (400, "malformed")


def test_bytes_that_trickle_in_do_not_buy_time(web):
    with web.connect() as stranger:
        stranger.sendall(b"GET / HTTP/1.1\r\n")
        stranger.settimeout(1.0)
        answer = b""
        for number in range(int(limits.HEAD_S) + 10):
            try:
                answer = stranger.recv(65536)
                break
            except TimeoutError:
                stranger.sendall(b"X-%d: y\r\n" % number)
    status, refusal = parsed(answer)
    assert (status, refusal["code"]) == (408, "request_too_slow")


def test_several_requests_go_by_one_connection(web):
    connection = http.client.HTTPConnection("127.0.0.1", web.port)
    for _ in range(3):
        connection.request("POST", "/api/v1/robots", body=b"x" * 1000)
        answer = connection.getresponse()
        assert (answer.status, answer.getheader("Connection")) == (401, None)
        answer.read()


def test_requests_on_one_connection_are_answered_in_order(web):
    with web.connect() as stranger:
        one = b"GET /robots/%s/ HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: text/html\r\n\r\n"
        last = b"GET /healthz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n"
        stranger.sendall(b"".join(one % path for path in (b"a", b"b", b"c")) + last)
        answers = heard(stranger)
    statuses = re.findall(rb"HTTP/1\.[01] (\d+)", answers)
    places = re.findall(rb"next=/robots/(\w)", answers)
    assert (statuses, places) == ([b"302", b"302", b"302", b"200"], [b"a", b"b", b"c"])
