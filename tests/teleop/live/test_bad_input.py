"""Invalid messages: refused with code and text, counted, never forwarded; the connection is kept."""

import json

import pytest

from robots.shared import wire
from teleop.live.consumers.message_socket import FLOOD_BURST, FLOOD_CLOSES_AFTER, CloseCode

pytestmark = pytest.mark.django_db(transaction=True)

FENCE = 1


def drive(**changes):
    return json.dumps({"t": "drive", "fence": FENCE, "seq": 1, "sent_ms": 5.0, "x": 0.5, "w": 0.0} | changes)


async def still_drives(page, bridge):
    """Check that the connection is open and no earlier message was forwarded."""
    assert not bridge.all(wire.Drive)
    await page.say_raw(drive(seq=99))
    assert (await bridge.hears(wire.Drive)).seq == 99


@pytest.mark.parametrize(
    ("what", "code"),
    [
        (drive().replace("0.5", "NaN"), "not_json"),
        (drive().replace("0.5", "Infinity"), "not_json"),
        (drive().replace("0.5", "-Infinity"), "not_json"),
        (drive().replace("0.5", "1e999"), "invalid"),
        (drive(x=1.01), "invalid"),
        (drive(w=-1.01), "invalid"),
        (drive(x="0.5"), "invalid"),
        (drive(x=None), "invalid"),
        (drive(x=[0.5]), "invalid"),
        (drive(seq=-1), "invalid"),
        (drive(seq=1.5), "invalid"),
        (drive(seq=2**53), "invalid"),
        (drive(share=0), "invalid"),
        (drive(fence=0), "invalid"),
        (drive(t="fly"), "invalid"),
        ('{"t":"drive"}', "invalid"),
        ('{"x":0.5}', "invalid"),
        ("[]", "invalid"),
        ("", "not_json"),
        ("go!", "not_json"),
        ("\ud800", "not_json"),
        (drive(padding="x" * 9000), "too_large"),
    ],
)
async def test_malformed_message_is_refused(holder, bridge, what, code):
    await holder.say_raw(what)
    await holder.refused(code)
    await still_drives(holder, bridge)


async def test_binary_frame_is_refused(holder, bridge):
    await holder.say_bytes(b"\x00")
    await holder.refused("not_text")
    await still_drives(holder, bridge)


async def test_old_fence_is_refused(holder, bridge):
    await holder.say_raw(drive(fence=FENCE + 1))
    refused = await holder.refused("old_fence")
    assert (refused["of"], refused["seq"], refused["fence"]) == ("drive", 1, FENCE + 1)
    await still_drives(holder, bridge)


async def test_driving_without_control_is_refused(open_page, bridge):
    page = await open_page("second")
    await page.say_raw(drive())
    await page.refused("no_lease")
    assert not bridge.all(wire.Drive)


async def test_control_of_one_robot_does_not_drive_another(holder, open_page, bridge, other_robot):
    other = await open_page("staff", slug=other_robot.slug)
    await other.say_raw(drive())
    await other.refused("no_lease")
    assert not bridge.all(wire.Drive)


async def test_first_message_must_be_hello(open_page):
    page = await open_page("operator", hello=False)
    await page.say("take")
    await page.refused("hello_first")


async def test_second_hello_is_refused(open_page):
    page = await open_page("operator")
    await page.say("hello", tab="another-tab-0123456789")
    await page.refused("hello_twice")


async def test_few_refusals_are_answered_but_all_are_counted(holder, bridge):
    for _ in range(100):
        await holder.say_raw("go!")
    await still_drives(holder, bridge)
    await holder.say("ping", sent_ms=1)
    await holder.hears("pong")
    assert sum(message["t"] == "refused" for message in holder.inbox) < 30


async def test_burst_after_a_stall_is_forwarded(holder, bridge):
    for seq in range(250):
        await holder.say_raw(drive(seq=seq))
    await holder.say("ping", sent_ms=1)
    await holder.hears("pong")
    assert "refused" not in [message["t"] for message in holder.inbox]


async def test_flood_is_refused_and_closes_the_connection(holder, bridge):
    for seq in range(int(FLOOD_BURST) + FLOOD_CLOSES_AFTER + 200):
        await holder.say_raw(drive(seq=seq))
    assert await holder.is_closed() == CloseCode.FLOOD
    assert "flood" in [m["refusal"]["code"] for m in holder.inbox if m["t"] == "refused"]
    assert len(bridge.all(wire.Drive)) <= FLOOD_BURST + 200


@pytest.mark.parametrize("what", ["go!", '{"t":"dance"}', "[]"])
async def test_flood_of_malformed_messages_closes_the_connection(holder, bridge, what):
    for _ in range(int(FLOOD_BURST) + FLOOD_CLOSES_AFTER + 200):
        await holder.say_raw(what)
    assert await holder.is_closed() == CloseCode.FLOOD


async def test_refusal_of_the_bridge_reaches_the_sending_page(holder, bridge):
    refusal = wire.Refusal("too_old", "The command was 0.5 s on its way.", "dead-man")
    bridge.say(wire.Refused("drive", refusal, seq=7, fence=FENCE))
    assert (await holder.refused("too_old"))["seq"] == 7


async def test_only_the_holder_plays_and_cancels_motions(open_page, holder, bridge):
    await holder.say("play", fence=FENCE, motion="wave")
    assert (await bridge.hears(wire.Play)).motion == "wave"
    await holder.say("play_cancel", fence=FENCE)
    assert (await bridge.hears(wire.PlayCancel)).fence == FENCE
    watching = await open_page("observer")
    await watching.say("play", fence=FENCE, motion="wave")
    assert (await watching.refused("no_lease"))["of"] == "play"
    assert len(bridge.all(wire.Play)) == 1


async def test_only_the_holder_lets_the_head_look_ahead(open_page, holder, bridge):
    await holder.say("look_ahead", fence=FENCE)
    assert (await bridge.hears(wire.LookAhead)).fence == FENCE
    await holder.say("look_ahead", fence=FENCE + 1)
    assert (await holder.refused("old_fence"))["of"] == "look_ahead"
    watching = await open_page("observer")
    await watching.say("look_ahead", fence=FENCE)
    assert (await watching.refused("no_lease"))["of"] == "look_ahead"
    assert len(bridge.all(wire.LookAhead)) == 1
