"""Both ends of the link together: over a Unix socket, and over TCP with TLS and a shared secret."""

from __future__ import annotations

import asyncio
import datetime
import ipaddress
import ssl
import uuid

import msgspec
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus, WebSocketException

import robots.link.client
from robots.bridge.link_handler import OTHER_ROBOT
from robots.bridge.server.link_server import LinkServer
from robots.link.client import BridgeLink, LinkRefused, Links
from robots.link.connections import _headers
from robots.link.state_reader import order_once, state_once
from robots.link.stop_delivery import reach, stop_message, wait_for
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from tests.bridge.support import CONFIG, Bench
from tests.processes import free_port

ROBOT = uuid.UUID(CONFIG.robot_id)  # the robot of the test bench


def stop_once(robot_id, address, by):
    """Press the stop without an event loop, as the command line does."""
    answer = wait_for(reach(address, stop_message(robot_id, by, "")))
    if isinstance(answer, wire.Refusal):
        raise LinkRefused(answer)
    return answer


class Bridge:
    """A link server with a core on the bench; answers as the process does."""

    def __init__(self, address: LinkAddress) -> None:
        self.bench = Bench().online()
        self.heard: list[wire.LinkRequest] = []
        self.drives: list[wire.Drive] = []
        self.server = LinkServer(
            address,
            lambda link: self.opened(link),  # at the time of the call: a test may replace it
            lambda link, raw: self.received(link, raw),
            self.closed,
        )
        self.lost = asyncio.Event()
        self.silent = False
        self.greets = True
        self.full = False  # its disk

    def opened(self, link):
        link.report(self.bench.core.hello())

    def closed(self, link):
        self.lost.set()

    async def received(self, link, raw):
        message = wire.link_request(raw)
        self.heard.append(message)
        if self.silent:
            return
        match message:
            case wire.Grant(fence=1):
                link.report(wire.Refused("grant", wire.Refusal("old_fence", "Too old.", "lease"), fence=1))
            case wire.Grant():
                link.report(wire.Granted(message.fence))
            case wire.Drive():
                self.drives.append(message)
            case wire.LinkHello() if self.greets:
                link.greeted = True
                link.report(wire.Status(self.bench.core.state(self.bench.now_s, [])))
            case wire.LinkState():
                link.report(wire.Status(self.bench.core.state(self.bench.now_s, [])))
            case wire.LinkRecord() if self.full:
                full = wire.Refusal("disk_full", "The disk is full.", "limits")
                link.report(wire.Refused("link_record", full, message.seq))
            case wire.LinkRecord():
                link.report(wire.Accepted("link_record", message.seq))
            case wire.LinkStop(robot=robot) if robot not in (None, ROBOT):
                link.report(wire.Refused("link_stop", OTHER_ROBOT, message.seq))
            case wire.LinkStop():
                self.bench.core.stop(message.by, message.reason, self.bench.now_s, message.press)
                link.report(wire.Stopped(self.bench.core.stop_state, message.seq, message.press))
            case wire.LinkClear():
                refusal = self.bench.core.clear(message.number, self.bench.now_s)
                answer = wire.Stopped(self.bench.core.stop_state, message.seq)
                link.report(wire.Refused("link_clear", refusal, message.seq) if refusal else answer)
            case wire.Viewers():
                link.watchers, link.watchers_more = message.watchers, message.more


class Follower:
    """A follower that stores the link's reports."""

    def __init__(self) -> None:
        self.views: list[str] = []
        self.news: asyncio.Queue[tuple[str, object]] = asyncio.Queue()

    def on_view(self, raw):
        self.views.append(raw)
        self.news.put_nowait(("view", raw))

    def on_status(self, state):
        self.news.put_nowait(("status", state))

    def on_ended(self, ended):
        self.news.put_nowait(("ended", ended))

    def on_refused(self, refused):
        self.news.put_nowait(("refused", refused))

    def on_offers(self, offers):
        self.news.put_nowait(("offers", offers))

    def on_path(self, path):
        self.news.put_nowait(("path", path))

    def on_sample(self, topic, sample):
        self.news.put_nowait(("sample", (topic, sample)))

    def on_link(self, up, refusal):
        self.news.put_nowait(("up" if up else "down", refusal))

    async def until(self, kind):
        while True:
            found, what = await asyncio.wait_for(self.news.get(), 10)
            if found == kind:
                return what

    async def until_refused(self, code):
        """Wait until the link is down with this refusal code."""
        while (refusal := await self.until("down")) is None or refusal.code != code:
            pass
        return refusal


@pytest.fixture
def certificate(tmp_path):
    """A self-signed certificate for 127.0.0.1: (certificate, key) as paths."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "bridge")])
    now = datetime.datetime.now(datetime.UTC)
    cert = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(hours=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), False
        )
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), True)
        .sign(key, hashes.SHA256())
    )
    paths = tmp_path / "cert.pem", tmp_path / "key.pem"
    paths[0].write_bytes(cert.public_bytes(serialization.Encoding.PEM))
    paths[1].write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    return str(paths[0]), str(paths[1])


@pytest.fixture(params=["unix", "tls"])
def address(request, tmp_path_factory, certificate):
    if request.param == "unix":
        return LinkAddress(unix_path=str(tmp_path_factory.mktemp("s") / "b.sock"))
    cert, key = certificate
    return LinkAddress(
        host="127.0.0.1", port=free_port(), certificate=cert, private_key=key, secret="s3cret", authority=cert
    )


@pytest.fixture
async def bridge(address):
    bridge = Bridge(address)
    await bridge.server.start()
    yield bridge
    await bridge.server.close()
    bridge.bench.close()


@pytest.fixture
async def link(bridge, address):
    link = BridgeLink(ROBOT, address)
    link.follower = Follower()
    link.subscribe(link.follower)
    await link.follower.until("up")
    yield link
    await link.close()


def grant(fence: int) -> wire.Grant:
    return wire.Grant(fence, 3.0, "session", "Ann", "ann", 1.0)


async def test_control_is_granted_and_refused_by_the_bridges_answer(link):
    await link.grant(grant(2))
    with pytest.raises(LinkRefused, match=r"Too old\."):
        await link.grant(grant(1))


async def test_a_drive_message_arrives_as_it_was_sent(link, bridge):
    raw = '{"t":"drive","fence":2,"seq":1,"sent_ms":5.25,"x":0.5,"w":-0.25,"share":1}'
    assert await link.forward(raw)
    await link.stop(wire.LinkStop("Ann"))  # the bridge answers in order
    assert bridge.drives == [wire.Drive(fence=2, seq=1, sent_ms=5.25, x=0.5, w=-0.25, share=1.0)]


async def test_a_bridge_that_goes_is_noticed_and_found_again(link, bridge, address):
    await bridge.server.close()
    refusal = await link.follower.until("down")
    assert refusal.code == "bridge_down"
    assert not await link.forward("{}")
    with pytest.raises(LinkRefused):
        await link.grant(grant(2))
    await bridge.server.start()
    await link.follower.until("up")
    await link.grant(grant(2))


async def test_a_bridge_that_does_not_answer_is_said_to_be_silent(link, bridge):
    bridge.silent = True
    with pytest.raises(LinkRefused) as refused:
        await link.grant(grant(2), timeout_s=0.05)
    assert refused.value.refusal.code == "bridge_silent"


async def test_the_bridge_notices_at_once_that_a_web_process_is_gone(link, bridge):
    await link.close()
    await asyncio.wait_for(bridge.lost.wait(), 2)


async def test_views_are_drawn_only_with_viewers(link, bridge):
    [remote] = bridge.server.links
    link.set_viewers(link.follower, ["Ann"])
    await link.stop(wire.LinkStop("Ann"))
    assert remote.watchers == ["Ann"]
    remote.show(b'{"t":"view"}')
    assert await link.follower.until("view") == '{"t":"view"}'
    link.set_viewers(link.follower, [])
    await link.stop(wire.LinkStop("Ann"))
    assert remote.watchers == []


async def test_leaving_follower_does_not_stop_a_new_ones_pictures(link, bridge):
    [remote] = bridge.server.links
    link.set_viewers(link.follower, ["Ann"])
    link.subscribe(successor := Follower())
    link.set_viewers(successor, ["Ben"])
    link.unsubscribe(link.follower)
    await link.stop(wire.LinkStop("Ann"))
    assert remote.watchers == ["Ben"]
    remote.show(b'{"t":"view"}')
    assert await successor.until("view") == '{"t":"view"}'


async def test_no_queue_grows_before_a_bridge_that_reads_nothing(link, bridge):
    [remote] = bridge.server.links
    remote._socket.transport.pause_reading()
    drive = '{"t":"drive","fence":2,"seq":1,"sent_ms":5,"x":0,"w":0,"padding":"' + "x" * 8000 + '"}'
    for _ in range(2000):
        if not await link.forward(drive):
            break
    for asked in (link.request_task(wire.Play(2, "wave")), link.query_topics(wire.ListTopics(), person=None)):
        with pytest.raises(LinkRefused) as refused:
            await asked
        assert refused.value.refusal.code == "busy"
    link.set_subscriptions(link.follower, {"/odom": 5.0})
    remote._socket.transport.resume_reading()
    await link.stop(wire.LinkStop("Ann"), timeout_s=10)
    assert await link.forward(drive)


async def test_a_large_answer_does_not_cut_the_link(link, bridge):
    [remote] = bridge.server.links
    asking = asyncio.ensure_future(link.query_topics(wire.ListTopics(), person=None))
    await link.stop(wire.LinkStop("Ann"))  # after this answer, the query has arrived, too
    large = wire.encode(wire.Parameter("/large", "x" * 3_000_000))
    remote.report(wire.LinkAnswer(1, msgspec.Raw(large)))
    assert await asking == large.decode()
    assert link.up


async def test_many_watchers_with_long_names_fit_into_a_message(link, bridge):
    [remote] = bridge.server.links
    link.set_viewers(link.follower, [f"{number:03} " + "Ü" * 190 for number in range(500)])
    await link.stop(wire.LinkStop("Ann"))
    assert (len(remote.watchers), remote.watchers_more) == (20, 480)
    assert remote.watchers[0].startswith("000 ")


async def test_a_bridge_that_ends_hears_no_command_any_more(link, bridge):
    bridge.server.shut()
    await link.forward('{"t":"drive","fence":2,"seq":1,"sent_ms":5.25,"x":0.5,"w":-0.25,"share":1}')
    await link.follower.until("down")
    await asyncio.wait_for(bridge.lost.wait(), 5)
    assert bridge.drives == []


async def test_the_stop_command_needs_no_event_loop(bridge, address):
    stopped = await asyncio.to_thread(stop_once, ROBOT, address, "the command line")
    assert stopped.stop.by == "the command line"
    assert bridge.bench.core.stop_state.state == "stopping"


async def test_stop_command_accepts_all_reports_of_the_robot(bridge, address, monkeypatch):
    offers = wire.Offers([wire.MotionOffer("long", "Long", description="x" * 3_000_000)])
    greet = bridge.opened
    monkeypatch.setattr(bridge, "opened", lambda link: (greet(link), link.report(offers)))
    stopped = await asyncio.to_thread(stop_once, ROBOT, address, "the command line")
    assert stopped.stop.state == "stopping"


async def test_a_stop_command_without_a_bridge_says_so(tmp_path):
    address = LinkAddress(unix_path=str(tmp_path / "nobody.sock"))
    with pytest.raises(LinkRefused, match="No supervisor runs on this computer"):
        await asyncio.to_thread(stop_once, ROBOT, address, "the command line")


async def test_an_answer_goes_to_the_question_that_it_answers(link, bridge):
    assert link.send(wire.LinkStop("Ben"))
    await asyncio.sleep(0)  # the stop is sent; nobody waits for its answer
    seen = bridge.bench.core.stop_state.number + 1
    assert (await link.clear(wire.LinkClear("Ann", seen), asked_s=0.0)).stop.state == "clear"


async def test_refused_clear_carries_the_bridges_reason(link, bridge):
    await link.stop(wire.LinkStop("Ben"))
    with pytest.raises(LinkRefused) as refused:
        await link.clear(wire.LinkClear("Ann", 77), asked_s=0.0)
    assert refused.value.refusal.code == "stopped_again"


async def test_late_answer_is_ignored(link, bridge):
    late = asyncio.ensure_future(link.stop(wire.LinkStop("Ben")))
    await asyncio.sleep(0)
    await asyncio.sleep(0)  # a separate task is sending it
    [(number, [waiting])] = link._latch._waiting.items()
    waiting.cancel()  # as in the first loop turn after a time-out
    link._handle_report(wire.Stopped(wire.StopState("stopping"), number))
    await asyncio.wait({late})
    await link.stop(wire.LinkStop("Ann"))
    assert link.up


async def test_a_follower_that_fails_ends_no_link_for_good(link, bridge):
    class Broken(Follower):
        def on_ended(self, ended):
            raise RuntimeError("a fault of ours")

    link.subscribe(Broken())
    [remote] = bridge.server.links
    remote.report(wire.Ended(1))
    assert (await link.follower.until("down")).code == "link_fault"
    await link.follower.until("up")
    await link.stop(wire.LinkStop("Ann"))


async def test_bridge_with_another_protocol_is_retried_with_pauses(address):
    asked = asyncio.Queue()

    def opened(link):
        asked.put_nowait(asyncio.get_running_loop().time())
        bench = Bench()
        hello = bench.core.hello()
        link.report(msgspec.structs.replace(hello, protocol=wire.PROTOCOL + 1))

    async def received(link, raw): ...

    server = LinkServer(address, opened, received, lambda link: None)
    await server.start()
    link = BridgeLink(ROBOT, address)
    try:
        times_s = [await asyncio.wait_for(asked.get(), 10) for _ in range(4)]
        assert (link.up, link.refusal.code) == (False, "protocol")
        # The pauses grow (0.1, 0.2, 0.4 s), although each connection opened.
        assert times_s[3] - times_s[2] >= 0.4
    finally:
        await link.close()
        await server.close()


async def test_a_link_that_is_ended_closes_after_its_last_word(link, bridge):
    [remote] = bridge.server.links
    remote.report(wire.Ended(1))
    remote.close_when_sent()
    assert (await link.follower.until("ended")).fence == 1
    await link.follower.until("down")


async def test_a_link_without_followers_is_closed(bridge, address, monkeypatch):
    monkeypatch.setattr(robots.link.client, "LINGER_S", 0.05)
    links, follower = Links(), Follower()
    link = links.get(ROBOT, address)
    link.subscribe(follower)
    await follower.until("up")
    assert link._linger_timer.cancelled()
    link.unsubscribe(follower)
    await asyncio.wait_for(bridge.lost.wait(), 5)
    assert link.closed
    assert links.get(ROBOT, address) is not link
    await links.close()


@pytest.mark.parametrize("turns", range(6))
async def test_a_link_closed_just_as_waiting_stops_are_read_ends(bridge, address, monkeypatch, turns):
    asked, answer = asyncio.Event(), asyncio.get_running_loop().create_future()

    async def waiting(_link):
        asked.set()
        return await answer

    monkeypatch.setattr(BridgeLink, "_waiting_stops", waiting)
    link = BridgeLink(ROBOT, address)
    await asked.wait()
    answer.set_result([])
    for _ in range(turns):
        await asyncio.sleep(0)
    closing = asyncio.get_running_loop().create_task(link.close())
    await asyncio.wait({closing}, timeout=2)
    assert closing.done()


async def test_stop_command_gives_up_on_a_bridge_without_answer(bridge, address):
    bridge.silent = True

    async def chatter():
        while True:
            for link in bridge.server.links:
                link.report(wire.Status(bridge.bench.core.state(bridge.bench.now_s, [])))
            await asyncio.sleep(0.02)

    talking = asyncio.create_task(chatter())
    try:
        with pytest.raises(LinkRefused) as refused:
            await asyncio.wait_for(asyncio.to_thread(stop_once, ROBOT, address, "the command line"), 5)
    finally:
        talking.cancel()
    assert refused.value.refusal.code == "bridge_silent"


async def test_a_stop_command_that_the_bridge_refuses_says_why(bridge, address, monkeypatch):
    async def refuse(link, raw):
        if b"link_stop" in raw:
            link.report(wire.Refused("link", wire.Refusal("invalid", "It does not fit.", "wire")))

    monkeypatch.setattr(bridge, "received", refuse)
    with pytest.raises(LinkRefused, match="does not fit"):
        await asyncio.to_thread(stop_once, ROBOT, address, "the command line")


class TestWhoseBridge:
    """Two robots with one bridge address: messages for one robot never reach the other."""

    @pytest.fixture
    async def stray(self, bridge, address):
        """The link of another robot to this robot's bridge."""
        link = BridgeLink(uuid.uuid4(), address)
        link.follower = Follower()
        link.subscribe(link.follower)
        yield link
        await link.close()

    async def test_the_link_never_comes_up_and_says_why(self, stray, bridge):
        refusal = await stray.follower.until_refused("other_robot")
        assert (refusal.rule, stray.up, stray.highest_fence) == ("robot", False, 0)
        assert "tiago" not in refusal.text  # people of this robot may not see the other

    async def test_bridge_that_gets_only_a_hello_refuses_the_stop(self, stray, bridge):
        stray.set_viewers(stray.follower, ["Ann"])
        stray.set_subscriptions(stray.follower, {"/odom": 5.0})
        await stray.follower.until_refused("other_robot")
        with pytest.raises(LinkRefused) as refused:
            await stray.grant(grant(2))
        assert refused.value.refusal.code == "other_robot"
        assert (await stray.stop(wire.LinkStop("Ann"))).code == "other_robot"
        assert bridge.bench.core.stop_state.state == "clear"
        assert not await stray.forward("{}")
        assert not stray.send(wire.Revoke(2, "over"))
        assert {type(message) for message in bridge.heard} == {wire.LinkHello, wire.LinkStop}

    async def test_a_stop_of_one_is_not_pressed_at_the_other(self, bridge, address):
        with pytest.raises(LinkRefused) as refused:
            await asyncio.to_thread(stop_once, uuid.uuid4(), address, "the command line")
        assert refused.value.refusal.code == "other_robot"
        assert bridge.bench.core.stop_state.state == "clear"

    async def test_other_robots_state_is_not_shown(self, bridge, address):
        assert (await asyncio.to_thread(state_once, ROBOT, address)).phase == "online"
        with pytest.raises(LinkRefused) as refused:
            await asyncio.to_thread(state_once, uuid.uuid4(), address)
        assert refused.value.refusal.code == "other_robot"

    async def test_questions_for_the_state_share_a_connection(self, bridge, address):
        links = set()
        for _ in range(3):
            await asyncio.to_thread(state_once, ROBOT, address)
            links |= bridge.server.links
        assert len(links) == 1

    async def test_housekeeping_begins_a_recording_without_a_loop_of_its_own(self, bridge, address):
        order = wire.LinkRecord(uuid.uuid4(), 60.0, "all", "Ann", "person-1", kind="booking")
        await asyncio.to_thread(order_once, ROBOT, address, order, 5.0)
        bridge.full = True
        with pytest.raises(LinkRefused) as refused:
            await asyncio.to_thread(order_once, ROBOT, address, order, 5.0)
        assert refused.value.refusal.code == "disk_full"
        bridge.silent = True
        with pytest.raises(LinkRefused):
            await asyncio.to_thread(order_once, ROBOT, address, order, 0.1)

    async def test_the_state_is_read_again_after_the_bridge_was_restarted(self, bridge, address):
        await asyncio.to_thread(state_once, ROBOT, address)
        await bridge.server.close()
        with pytest.raises(LinkRefused) as refused:
            await asyncio.to_thread(state_once, ROBOT, address)
        assert refused.value.refusal.code == "bridge_down"
        again = Bridge(address)
        await again.server.start()
        assert (await asyncio.to_thread(state_once, ROBOT, address)).phase == "online"
        await again.server.close()

    async def test_stop_without_a_robot_id_stops_any_robot_there(self, bridge, address):
        await asyncio.to_thread(stop_once, None, address, "the command line")
        assert bridge.bench.core.stop_state.state == "stopping"

    async def test_before_the_bridges_hello_only_a_stop_is_sent(self, bridge, address, monkeypatch):
        bridge.greets = False
        connected, greet = asyncio.Event(), bridge.opened
        monkeypatch.setattr(bridge, "opened", lambda _link: connected.set())
        link = BridgeLink(ROBOT, address)
        link.set_viewers(follower := Follower(), ["Ann"])
        link.set_subscriptions(follower, {"/odom": 5.0})
        await asyncio.wait_for(connected.wait(), 5)
        with pytest.raises(LinkRefused):
            await link.grant(grant(2))
        assert (await link.stop(wire.LinkStop("Ann"))).stop.by == "Ann"
        assert {type(message) for message in bridge.heard} == {wire.LinkHello, wire.LinkStop}
        greet(remote := next(iter(bridge.server.links)))
        remote.report(wire.Status(bridge.bench.core.state(bridge.bench.now_s, [])))
        link.subscribe(follower)
        await follower.until("up")
        await link.stop(wire.LinkStop("Ben"))
        heard = {type(message) for message in bridge.heard}
        assert heard == {wire.LinkHello, wire.Viewers, wire.LinkSubscribe, wire.LinkStop}
        assert remote.watchers == ["Ann"]
        await link.close()

    async def test_a_bridge_of_another_protocol_is_stopped_all_the_same(self, bridge, address, monkeypatch):
        def opened(link):
            hello = {"t": "bridge_hello", "protocol": wire.PROTOCOL + 1, "robot": str(ROBOT), "slug": "tiago"}
            offers = {"t": "offers", "motions": 5}  # not a valid value
            link._reports.extend(map(msgspec.json.encode, (hello, offers)))
            link._news.set()

        monkeypatch.setattr(bridge, "opened", opened)
        await asyncio.to_thread(stop_once, ROBOT, address, "the command line")
        assert bridge.bench.core.stop_state.state == "stopping"


class TestTcp:
    @pytest.fixture
    def address(self, certificate):
        cert, key = certificate
        return LinkAddress(
            host="127.0.0.1",
            port=free_port(),
            certificate=cert,
            private_key=key,
            secret="s3cret",
            authority=cert,
        )

    @pytest.mark.parametrize("header", [{}, {"Authorization": "Bearer wrong"}, {"Authorization": "Bearer "}])
    async def test_a_link_without_the_shared_secret_is_refused(self, bridge, address, header):
        trust = ssl.create_default_context(cafile=address.authority)
        with pytest.raises(InvalidStatus, match="401"):
            async with connect(f"wss://127.0.0.1:{address.port}/", ssl=trust, additional_headers=header):
                pass

    async def test_a_web_process_that_knows_no_secret_does_not_say_one(self, address):
        assert _headers(address) == {"Authorization": "Bearer s3cret"}
        assert _headers(msgspec.structs.replace(address, secret=None)) == {}

    async def test_a_link_without_tls_does_not_open(self, bridge, address):
        with pytest.raises((OSError, WebSocketException)):
            async with connect(f"ws://127.0.0.1:{address.port}/", open_timeout=2):
                pass

    async def test_other_computers_are_served_beside_this_one(self, address, tmp_path):
        """Only a web process on the bridge's computer has the lane and the socket."""
        near = msgspec.structs.replace(address, unix_path=str(tmp_path / "b.sock"))
        far = msgspec.structs.replace(address, unix_path=str(tmp_path / "elsewhere.sock"))
        bridge = Bridge(near)
        bridge.server._on_quick = lambda link, raw: None  # so links on this computer have a lane
        await bridge.server.start()
        links = [BridgeLink(ROBOT, address) for address in (near, far)]
        for fence, link in enumerate(links, 2):
            link.follower = Follower()
            link.subscribe(link.follower)
            await link.follower.until("up")
            await link.grant(grant(fence))
        await links[1].stop(wire.LinkStop("Ann"))
        assert [link.has_lane for link in links] == [True, False]
        for one in (near, far):
            assert (await asyncio.to_thread(state_once, ROBOT, one)).phase == "online"
        for link in links:
            await link.close()
        await bridge.server.close()
        bridge.bench.close()

    async def test_a_bridge_that_does_not_run_is_to_be_started_there(self, address):
        with pytest.raises(LinkRefused, match="on another computer: start the bridge there"):
            await asyncio.to_thread(stop_once, ROBOT, address, "the command line")

    async def test_tcp_link_needs_certificate_and_secret(self):
        server = LinkServer(LinkAddress(host="127.0.0.1", port=free_port()), print, print, print)
        with pytest.raises(ValueError, match="certificate, a private key and a shared secret"):
            await server.start()
