/** The page of devices that get notifications. The browser asks its person only after the press of the button. */

import { send } from "../connection/write.js";
import { setText, show } from "../lib/dom.js";

/** The sentence for a browser that cannot; null: it can. */
export function whyNot(window) {
  if (!window.isSecureContext)
    return gettext("Notifications need https: ask the staff for the console’s secure address.");
  if (!("PushManager" in window && "serviceWorker" in window.navigator))
    return gettext(
      "This browser cannot get notifications. On an iPhone or iPad, add the console to the home screen first, and open it there.",
    );
  if (window.Notification.permission === "denied")
    return gettext(
      "You forbade notifications of this console: allow them in the browser’s settings.",
    );
  return null;
}

async function digestOf(text) {
  const bytes = await crypto.subtle.digest("SHA-256", new TextEncoder().encode(text));
  return [...new Uint8Array(bytes)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Ask the person, then the browser's push service. @throws {Error} with a sentence for people */
async function subscribe(key) {
  if ((await Notification.requestPermission()) !== "granted") throw new Error(whyNot(window) ?? "");
  const { pushManager } = await navigator.serviceWorker.ready;
  await (await pushManager.getSubscription())?.unsubscribe(); // it may be of another key or person
  try {
    return await pushManager.subscribe({ userVisibleOnly: true, applicationServerKey: key });
  } catch {
    throw new Error(gettext("The push service of this browser does not answer: try again later."));
  }
}

class DevicesPage {
  #root;
  #button;
  #said;

  constructor(root) {
    this.#root = root;
    this.#button = root.querySelector("[data-part=notify]");
    this.#said = root.querySelector("[data-part=said]");
    this.#button.addEventListener("click", () => this.#add());
    this.#begin();
  }

  async #begin() {
    const why = whyNot(window);
    setText(this.#said, why ?? "");
    show(this.#button, why === null);
    if (why !== null) return;
    const registration = await navigator.serviceWorker.getRegistration();
    const known = await registration?.pushManager.getSubscription();
    const digest = known && (await digestOf(known.endpoint));
    const row = digest && this.#root.querySelector(`[data-digest="${digest}"]`);
    if (!row) return;
    show(row.querySelector("[data-part=here]"), true);
    show(this.#button, false);
  }

  async #add() {
    this.#button.disabled = true;
    try {
      const subscription = await subscribe(this.#root.dataset.key);
      await send("POST", this.#root.dataset.add, subscription.toJSON());
      location.reload();
    } catch (error) {
      setText(this.#said, error.message);
      this.#button.disabled = false;
    }
  }
}

const root = document.querySelector("[data-page=devices]");
if (root) new DevicesPage(root);
