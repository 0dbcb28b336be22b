// Passkeys by django-allauth's scripts: if a passkey cannot be used, the page shows the reason.

const BUTTONS =
  "#passkey_login, #mfa_webauthn_add, #mfa_webauthn_authenticate, #mfa_webauthn_reauthenticate";

/** Put a sentence under the pressed button; screen readers read it. */
function say(button, text) {
  const place =
    button.parentElement.querySelector("[data-passkey-note]") ?? document.createElement("p");
  place.dataset.passkeyNote = "";
  place.className = "fault";
  place.setAttribute("role", "alert");
  place.textContent = text;
  button.after(place);
}

const buttons = [...document.querySelectorAll(BUTTONS)];

if (!window.PublicKeyCredential) {
  for (const button of buttons) {
    button.disabled = true;
    button.title = gettext(
      "Browsers allow passkeys only at an https:// address with a name, not a number.",
    );
  }
}

document.addEventListener("allauth.error", (event) => {
  event.preventDefault();
  const button = buttons.find((each) => each === document.activeElement) ?? buttons[0];
  const cancelled = event.detail.exception?.name === "NotAllowedError";
  if (button) {
    say(
      button,
      cancelled
        ? gettext("The passkey was not used: you cancelled, or it took too long. Try again.")
        : gettext("This passkey does not work here. Try again, or sign in another way."),
    );
  }
});
