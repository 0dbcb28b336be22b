/** The sign-in page while many people sign in: their place in the queue, until the answer replaces the page. */

const QUICK_MS = 800; // without a queue the answer is there before
const EVERY_MS = 1000;

/**
 * Return the words about a place.
 * @param {{ahead: number | null}} place people before this one; null: it is this one's turn
 */
export function words({ ahead }) {
  if (!ahead) return gettext("Your password is being checked…");
  const text = ngettext(
    "Many people sign in. %s person is before you…",
    "Many people sign in. %s people are before you…",
    ahead,
  );
  return interpolate(text, [ahead]);
}

/** Show the place under the button as long as the page is there. */
async function follow(status, ticket) {
  status.hidden = false;
  for (;;) {
    try {
      const answer = await fetch(`/accounts/sign-in/place/?ticket=${ticket}`);
      status.textContent = words(await answer.json());
    } catch {
      // the answer to the form replaces the page, or the browser says that there is none
    }
    await new Promise((resolve) => setTimeout(resolve, EVERY_MS));
  }
}

const form = document.querySelector("form.sign-in");
form?.addEventListener("submit", () => {
  const ticket = Array.from(crypto.getRandomValues(new Uint8Array(8)), (one) =>
    one.toString(16),
  ).join("");
  form.action = `${form.getAttribute("action").split("?")[0]}?ticket=${ticket}`;
  const status = form.querySelector("[data-part=place]");
  setTimeout(() => follow(status, ticket), QUICK_MS);
});
addEventListener("pageshow", () => {
  const status = form?.querySelector("[data-part=place]");
  if (status) status.hidden = true; // back from the next page
});
