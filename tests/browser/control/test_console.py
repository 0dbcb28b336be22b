"""All actions of an operator besides driving: tabs, motions, speech, notices, keys."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable

import pytest
from playwright.sync_api import Locator, WebSocketRoute, expect

from benchmarks.parts import process_stats
from script.stack.stack import Stack
from tests.browser.people import Person
from tests.browser.test_pages import SIZES, axe_accepts, box_of, found_by_axe, overlap

Arrive = Callable[..., Person]

TABS = ["Centre", "Drive", "Motions", "Speech", "Topics"]


def go_to(person: Person, name: str) -> None:
    """Press a tab and wait until it is shown."""
    tab = person.page.get_by_role("tab", name=name)
    person.page.mouse.move(0, 0)  # a notice below the pointer stays
    size = person.page.viewport_size
    if size and size["width"] < 1000:  # a notice covers the tabs of a phone for 5 s
        expect(person.part("notices").locator("li")).to_have_count(0)
    tab.click()
    person.until(lambda: tab.get_attribute("aria-selected") == "true", f"the tab {name}")


def notice(person: Person, text: str | re.Pattern[str]) -> Locator:
    """Wait for a notice with this text."""
    found = person.part("notices").get_by_text(text).first
    found.wait_for()
    return found


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_stop_keeps_its_place_on_every_tab(person: Arrive, width: int, height: int) -> None:
    operator = person("operator", width=width, height=height, touch=width < 1000)
    operator.take("tiago-2")
    places = []
    for name in TABS:
        go_to(operator, name)
        stop = box_of(operator.page.locator("form.stop .stop-button"))
        places.append(stop)
        size = operator.page.evaluate(
            "[document.scrollingElement.scrollWidth, document.scrollingElement.scrollHeight]"
        )
        assert size == [width, height], name
        wider = operator.page.evaluate(
            "[...document.querySelectorAll('.speech, .topics')].filter((it) => it.scrollWidth > it.clientWidth).length"
        )
        assert wider == 0, name
        axe_accepts(operator, name)
        if name in ("Centre", "Drive"):
            stick = box_of(operator.part("zone"))
            assert min(stick["width"], stick["height"]) >= (180 if height > 400 else 170)
            assert stick["y"] + stick["height"] <= height
            assert not overlap(stick, stop)
        else:
            assert not operator.part("zone").is_visible()
    assert all(place == places[0] for place in places)
    operator.release()


def test_the_address_names_the_tab(person: Arrive) -> None:
    observer = person("observer")
    observer.watch("tiago-2")
    go_to(observer, "Speech")
    assert observer.page.url.endswith("#speech")
    go_to(observer, "Motions")
    observer.page.go_back()
    observer.page.locator(".control[data-tab=speech]").wait_for()
    observer.page.reload()
    observer.page.locator(".control[data-tab=speech]").wait_for()
    # By keys: arrows choose a tab.
    observer.page.get_by_role("tab", name="Speech").focus()
    observer.page.keyboard.press("ArrowLeft")
    observer.page.locator(".control[data-tab=motions]").wait_for()
    assert observer.complaints == []


def waits_for(operator: Person) -> str | None:
    needed = operator.state["neutral_needed"]
    return needed["code"] if needed else None


def test_a_change_of_tab_stops_the_base_and_latches_nothing(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    operator.forget()
    operator.push("ArrowDown", until=lambda: waits_for(operator) == "behind_unseen", what="a refusal")
    operator.let_go("ArrowDown")
    operator.until(lambda: operator.state["neutral_needed"] is None, "a free stick")
    expect(operator.part("turn")).to_have_attribute("data-offered", "true")
    operator.drive("ArrowDown", metres=0.1)  # the second pull: the operator has looked
    expect(operator.part("turn")).not_to_have_attribute("data-offered", "true")
    operator.page.evaluate("location.hash = 'motions'")
    operator.until(lambda: operator.last_drive == (0, 0, 0), "a stick in the middle")
    operator.until_still()
    assert operator.state["stop"]["state"] == "clear"
    operator.page.keyboard.up("ArrowDown")
    operator.release()


def test_a_motion_is_played_shown_cancelled_and_exclusive(person: Arrive) -> None:
    operator, supervisor = person("operator"), person("supervisor")
    operator.take("tiago-2")
    supervisor.watch("tiago-2")
    go_to(operator, "Motions")
    row = operator.part("motion-list").locator(".hit").filter(has_text="Inspect surroundings")
    place = [box_of(row), box_of(row.get_by_text("Play"))]
    operator.press("Play Inspect surroundings")
    operator.until(lambda: operator.state["motion"] is not None, "the motion")
    assert [box_of(row), box_of(row.get_by_text("Cancel"))] == place
    search = operator.page.get_by_label("Search motions", exact=True)
    search.fill("WÀV")
    search.press("Enter")
    notice(operator, re.compile("Play Wave: .*requested by Operator"))
    search.press("Escape")
    assert search.input_value() == ""
    operator.press("Cancel Inspect surroundings")
    notice(operator, "Inspect surroundings: cancelled.")
    assert [box_of(row), box_of(row.get_by_text("Play"))] == place

    operator.press("Play Head tour")
    supervisor.part("motion-cancel").click()  # supervisors need no control for this
    notice(operator, "Head tour: cancelled. Cancelled by Supervisor.")
    expect(notice(supervisor, "Head tour: cancelled.")).not_to_contain_text("by")

    operator.press("Play Inspect surroundings")
    for name in TABS:
        go_to(operator, name)
        expect(operator.part("motion-cancel"), name).to_be_visible()
        expect(operator.part("motion-words")).to_have_text("Inspect surroundings")
    operator.part("motion-cancel").click()
    operator.until(lambda: operator.state["motion"] is None, "the end of the motion")
    operator.release()


def test_texts_are_said_cancelled_chosen_and_repeated(
    person: Arrive,
) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    go_to(operator, "Speech")
    operator.part("language").click()
    operator.page.get_by_label("Search languages").fill("spanish")
    operator.page.keyboard.press("Enter")
    text = operator.part("say-text")
    text.fill("Me llamo TIAGo.")
    text.press("Enter")
    operator.until(lambda: (operator.state["speech"] or {}).get("word"), "a word that is spoken")
    assert operator.state["speech"]["language"].startswith("es")
    expect(operator.part("speech-word")).not_to_be_empty()
    notice(operator, "Said: “\u2068Me llamo TIAGo.\u2069”")
    newest = operator.part("history-list").locator(".hit").first
    operator.until(lambda: "done" in newest.inner_text(), "its end in the history")
    assert "Me llamo TIAGo." in newest.inner_text()

    text.fill("Esta frase es demasiado larga para escucharla hasta el final, así que alguien la cancela.")
    text.press("Enter")
    operator.part("speech-cancel").click()
    notice(operator, re.compile("Cancelled: “\u2068Esta frase"))

    go_to(operator, "Centre")
    operator.part("phrase-list").get_by_role("button").first.click()
    operator.until(lambda: operator.state["speech"] is not None, "the phrase")
    operator.until(lambda: operator.state["speech"] is None, "its end")
    assert operator.state["speech_ended"]["outcome"] == "done"
    go_to(operator, "Speech")
    mine = operator.part("history-list").locator(".hit").filter(has_text="Me llamo TIAGo.").first
    mine.get_by_role("button", name="Repeat").click()
    operator.until(lambda: (operator.state["speech"] or {}).get("text") == "Me llamo TIAGo.", "the repeat")
    assert operator.state["speech"]["language"].startswith("es")
    operator.part("speech-cancel").click()
    operator.until(lambda: operator.state["speech"] is None, "its end")
    operator.release()


def test_keys_write_in_a_field_and_a_question_mark_shows_help(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    go_to(operator, "Speech")
    operator.part("say-text").press_sequentially("was? ")
    assert operator.part("say-text").input_value() == "was? "
    assert operator.state["stop"]["state"] == "clear"
    assert all((drive["x"], drive["w"]) == (0, 0) for drive in operator.drives)
    go_to(operator, "Drive")
    operator.page.keyboard.press("?")
    expect(operator.page.get_by_role("dialog", name="Keyboard and gamepad")).to_be_visible()
    assert found_by_axe(operator) == []
    operator.page.keyboard.press("Escape")
    assert not operator.page.get_by_role("dialog").is_visible()
    operator.release()


def logged(person: Person) -> list[str]:
    """Return the logged notices, newest first, each once. Omit late answers, which a busy computer causes."""
    person.part("log-open").evaluate("button => button.click()")
    texts = person.part("log-list").locator("p > span").all_text_contents()
    person.part("log-dialog").evaluate("dialog => dialog.close()")
    return list(dict.fromkeys(text for text in texts if "no answer within" not in text))


def test_each_control_action_gives_one_notice(person: Arrive) -> None:
    operator, supervisor = person("operator"), person("supervisor")
    operator.take("tiago-2")
    supervisor.watch("tiago-2")
    operator.press("More time")
    operator.until(lambda: "You keep control" in logged(operator)[0], "a fresh term")
    for name in ("Ask for control", "Leave the line", "Ask for control"):
        supervisor.press(name)
    operator.press("Hand over to Supervisor")
    supervisor.until_in_control()
    supervisor.release()
    supervisor.until(lambda: logged(supervisor)[0] == "You released control.", "the last of it in the log")
    assert logged(supervisor) == [
        "You released control.",
        "Control was handed to you.",
        "You wait in line. Operator knows that you ask for control.",
        "You have left the line.",
    ]
    assert [text.split(":")[0] for text in logged(operator)] == [
        "You handed over to Supervisor.",
        "Supervisor asks for control.",
        "You keep control",
        "You have control.",
    ]


def test_buttons_that_have_done_their_work_hand_the_focus_on(person: Arrive) -> None:
    operator = person("operator")
    operator.watch("tiago-2")
    focused = operator.page.locator(":focus")
    operator.page.get_by_role("button", name="Take control").press("Enter")
    operator.until_in_control()
    expect(focused).to_have_attribute("data-action", "renew")
    operator.page.get_by_role("button", name="Release", exact=True).press("Enter")
    expect(focused).to_have_attribute("data-action", "take")


def test_quick_presses_do_not_give_control_away(person: Arrive) -> None:
    operator, staff = person("operator", width=360, height=640), person("staff")
    operator.watch("tiago-2")
    take = box_of(operator.page.get_by_role("button", name="Take control"))
    mouse, (x, y) = operator.page.mouse, (take["x"] + take["width"] * 0.6, take["y"] + take["height"] / 2)
    mouse.click(x, y)
    operator.until_in_control()
    operator.page.get_by_role("button", name="Release", exact=True).wait_for()
    assert (
        operator.page.evaluate("([x, y]) => document.elementFromPoint(x, y).innerText", [x, y]) == "Release"
    )
    mouse.down(click_count=2)
    mouse.up(click_count=2)
    operator.page.evaluate(
        """() => new MutationObserver(([{ target }]) => { window.came ??= target.querySelector("button")?.disabled; })
          .observe(document.querySelector(".requests"), { childList: true })"""
    )
    staff.watch("tiago-2")
    staff.press("Ask for control")
    operator.press("Hand over to Staff")  # this press waits: at first the button is disabled
    assert operator.page.evaluate("came") is True
    assert "release" not in operator.sent
    staff.until_in_control()
    staff.release()


def test_choices_are_visible_in_forced_colours(person: Arrive) -> None:
    observer = person("observer")
    observer.page.emulate_media(forced_colors="active")
    observer.watch("tiago-2")
    colours = "e => getComputedStyle(e).borderBottomColor + getComputedStyle(e).backgroundColor"
    for kind, state in (("[role=tab]", "aria-selected"), (".segments button", "aria-pressed")):
        on, off = (
            observer.page.locator(f"{kind}[{state}={value}]").first.evaluate(colours)
            for value in ("true", "false")
        )
        assert on != off, kind


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_notices_are_logged_and_never_cover_stop_or_stick(person: Arrive, width: int, height: int) -> None:
    observer = person("observer", width=width, height=height)
    observer.watch("tiago-2")
    observer.open_drawer("Actions")
    play = observer.part("motion-list").get_by_role("button").first
    play.wait_for()
    for _ in range(6):
        play.evaluate("button => button.click()")
    notice(observer, re.compile("Take control first"))
    expect(observer.page.locator(".notices .notice-times").first).to_have_text(re.compile("6$"))
    shown = box_of(observer.page.locator(".notices .notice").first)  # soon the notice disappears
    for protected in (observer.page.locator("form.stop .stop-button"), observer.part("zone")):
        assert not overlap(shown, box_of(protected))
    assert found_by_axe(observer) == []
    menu = observer.page.locator(".menu summary")
    menu.press("Enter")
    observer.page.get_by_role("button", name="Notices").press("Enter")
    log = observer.page.get_by_role("dialog", name="Notices")
    expect(log.get_by_text(re.compile(r"^.6$"))).to_be_visible()
    observer.page.keyboard.press("Escape")
    expect(log).to_be_hidden()
    assert menu.evaluate("menu => menu === document.activeElement")


def test_the_page_on_cookies_names_those_of_the_browser(person: Arrive) -> None:
    observer = person("observer")
    observer.open("/")
    observer.page.locator(".menu summary").click()
    observer.page.get_by_role("link", name="Cookies").click()
    names = {cookie["name"] for cookie in observer.context.cookies()}
    for name in names:
        observer.page.get_by_text(name, exact=True).wait_for()
    assert len(names) == 2


def bridge_of(stack: Stack, slug: str) -> int:
    """Return the process id of the robot's bridge."""
    [bridge] = [
        child
        for child in process_stats.children(stack.supervisor.pid)
        if {"fleet.site.run_bridge", slug} <= set(process_stats.arguments(child))
    ]
    return bridge


def test_control_taken_over_during_a_lost_link_is_reported(person: Arrive) -> None:
    operator, supervisor = person("operator", apart=True), person("supervisor")
    sockets: list[WebSocketRoute] = []
    lost = False

    def connect(socket: WebSocketRoute) -> None:
        if lost:
            socket.close()
        else:
            sockets.append(socket)
            socket.connect_to_server()

    operator.page.route_web_socket(re.compile("/ws/robots/tiago-2/$"), connect)
    operator.open("/robots/tiago-2/")
    operator.press("Take control")
    operator.page.get_by_role("button", name="Release", exact=True).wait_for()
    supervisor.watch("tiago-2")
    lost = True
    sockets[0].close()
    operator.part("reason").get_by_text("No connection").wait_for()
    supervisor.press("Take over…")
    dialog = supervisor.page.get_by_role("dialog", name="Take over control?")
    dialog.get_by_label("Reason", exact=True).fill("a test")
    dialog.get_by_label("Reason", exact=True).press("Enter")
    supervisor.until_in_control()
    lost = False
    operator.part("who").get_by_text("Supervisor has control").wait_for()
    assert logged(operator)[0] == "Control ended while the connection was lost."
    supervisor.release()


def test_an_old_page_after_an_upgrade_can_only_stop(person: Arrive) -> None:
    operator, observer = person("operator", apart=True), person("observer")
    sockets: list[WebSocketRoute] = []
    upgraded = False

    def connect(socket: WebSocketRoute) -> None:
        sockets.append(socket)
        console = socket.connect_to_server()
        if upgraded:
            console.on_message(lambda text: socket.send(re.sub(r'"protocol":\d+', '"protocol":0', str(text))))

    observer.watch("tiago-2")
    operator.page.route_web_socket(re.compile("/ws/robots/tiago-2/$"), connect)
    operator.open("/robots/tiago-2/#topics")
    operator.press("Take control")
    operator.page.get_by_role("button", name="Release", exact=True).wait_for()
    upgraded = True
    sockets[0].close()
    reason = operator.part("reason")
    reason.get_by_text("This page is of another version").wait_for()
    expect(reason.get_by_role("button")).to_have_text("Load again")
    operator.page.locator("form.stop .stop-button").click()
    observer.until(lambda: observer.state["stop"]["state"] == "stopped", "the stop")
    assert len(sockets) == 2
    expect(reason).to_contain_text("it can only stop the robot")
    upgraded = False
    operator.press("Load again")
    operator.press("Clear stop…")
    operator.page.get_by_role("dialog").get_by_role("button", name="Clear stop").click()
    observer.until(lambda: observer.state["stop"]["state"] == "clear", "a robot that may drive")
    operator.release()


def test_a_silent_robot_is_shown_and_inputs_give_way(person: Arrive, stack: Stack) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    go_to(operator, "Motions")
    motions, reason = operator.part("motion-list"), operator.part("reason")
    wave = operator.page.get_by_role("button", name="Play Wave")
    wave.wait_for()
    bridge = bridge_of(stack, "tiago-2")
    os.kill(bridge, signal.SIGSTOP)
    try:
        wave.evaluate("button => button.click()")  # at once
        notice(operator, re.compile("Play Wave: no answer within 0.75 s"))
        motions.wait_for(state="hidden")
        assert re.search(
            "The server has not answered for .* s.*What you see is old",
            reason.inner_text(),
            re.DOTALL,
        )
    finally:
        os.kill(bridge, signal.SIGCONT)
    motions.wait_for()
    operator.until_in_control()
    operator.fold_arm()  # the robot may have waved
    operator.release()


def test_out_of_reach_inputs_give_way_except_open_fields(person: Arrive, stack: Stack) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    motions, reason, text = (operator.part(name) for name in ("motion-list", "reason", "say-text"))
    operator.press("Play Inspect surroundings")
    operator.until(lambda: operator.heard.get("accepted", {}).get("of") == "play", "the motion")
    go_to(operator, "Speech")
    text.press_sequentially("was")
    bridge = bridge_of(stack, "tiago-2")
    os.kill(stack.supervisor.pid, signal.SIGSTOP)  # prevents a new bridge, also in a slow browser
    try:
        os.kill(bridge, signal.SIGKILL)
        operator.page.locator(".control[data-cut]").wait_for()
        operator.page.keyboard.type(" wo dd")  # outside a field, letters would drive and a space would stop
        assert text.input_value() == "was wo dd"
        expect(reason).to_contain_text("No link to the robot")
        go_to(operator, "Motions")
        assert not motions.is_visible()
    finally:
        os.kill(stack.supervisor.pid, signal.SIGCONT)
    motions.wait_for()  # the supervisor started another bridge
    assert not reason.is_visible() or "stick" in reason.inner_text()
    notice(operator, "Inspect surroundings: the robot did not report its end.")
    assert operator.state["stop"]["state"] == "clear"
    assert operator.complaints == []
    operator.until_in_control()
    operator.release()
