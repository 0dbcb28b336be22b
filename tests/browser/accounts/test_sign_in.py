"""Second factors in a real browser: an authenticator app, and a passkey that signs in alone."""

from __future__ import annotations

from collections.abc import Callable

from allauth.mfa.totp.internal import auth
from playwright.sync_api import Page, expect

from tests.browser.people import Person

KEY = {"protocol": "ctap2", "transport": "internal", "hasResidentKey": True, "hasUserVerification": True}
PRESENT = {"isUserVerified": True, "automaticPresenceSimulation": True}


def test_an_app_and_a_passkey_are_set_up_and_used(person: Callable[..., Person]) -> None:
    somebody = person("observer", apart=True)
    page, account = somebody.page, somebody.account
    console = somebody.stack.url.replace("127.0.0.1", "localhost")  # a passkey needs a host name
    devices = somebody.context.new_cdp_session(page)
    devices.send("WebAuthn.enable")
    devices.send("WebAuthn.addVirtualAuthenticator", {"options": KEY | PRESENT})
    page.goto(console)
    _password(page, account.username, account.password)
    page.wait_for_url(f"{console}/")

    page.goto(f"{console}/accounts/")
    page.get_by_role("link", name="Set up Second factor").click()
    page.get_by_role("link", name="Set up an app").click()
    page.get_by_label("Password", exact=True).fill(account.password)
    page.get_by_role("button", name="Confirm").click()
    secret = page.locator("main code").inner_text()
    page.get_by_label("Authenticator code").fill(_code(secret))
    page.get_by_role("button", name="Turn it on").click()
    expect(page.get_by_label("Unused codes")).to_be_visible()
    page.goto(f"{console}/accounts/second-factor/")
    page.get_by_role("link", name="Add one").click()
    page.get_by_role("button", name="Add").click()
    expect(page.get_by_role("link", name="Show them").first).to_be_visible()

    _sign_out(page)
    _password(page, account.username, account.password)
    page.get_by_label("Code of your authenticator app").fill("000000")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("alert")).to_contain_text("Incorrect code")
    page.get_by_role("button", name="Use a passkey or key").click()
    page.wait_for_url(f"{console}/")
    _sign_out(page)
    page.get_by_role("button", name="Sign in with a passkey").click()
    page.wait_for_url(f"{console}/")

    page.goto(f"{console}/accounts/second-factor/webauthn/")
    page.get_by_role("link", name="Remove").click()
    page.get_by_label("Password", exact=True).fill(account.password)
    page.get_by_role("button", name="Confirm").click()
    page.get_by_role("button", name="Remove").click()
    page.goto(f"{console}/accounts/second-factor/totp/deactivate/")
    page.get_by_role("button", name="Deactivate").click()
    expect(page.get_by_role("link", name="Set up an app")).to_be_visible()
    assert somebody.complaints == []


def _password(page: Page, name: str, password: str) -> None:
    page.get_by_label("User name").fill(name)
    page.get_by_label("Password", exact=True).fill(password)
    page.get_by_role("button", name="Sign in", exact=True).click()


def _sign_out(page: Page) -> None:
    page.locator(".menu summary").click()
    page.get_by_role("button", name="Sign out").click()


def _code(secret: str) -> str:
    counter = next(iter(auth.yield_hotp_counters_from_time()))
    return str(auth.format_hotp_value(auth.hotp_value(secret, counter)))
