/** While a dialog is open, nothing beside it acts, except stops. Dialogs are not modal: `showModal` would bar these, too. */

/** Stops, other dialogs, what a screen reader must hear at once, and the joystick, which says why it does not drive. */
const FREE =
  "dialog, .stop-button, .zone, .notices, [data-part=said], [data-part=alarm], [data-part=live], [data-part=stop-all-state]";

/** Return the largest parts of the page beside a dialog without anything that stays free. */
function besideOf(dialog) {
  const found = [];
  for (
    let within = dialog;
    within?.parentElement && within !== document.body;
    within = within.parentElement
  )
    for (const other of within.parentElement.children)
      if (other !== within) found.push(...partsOf(other));
  return found.filter((part) => !part.hasAttribute("inert"));
}

function partsOf(element) {
  if (element.matches(FREE)) return [];
  return element.querySelector(FREE) ? [...element.children].flatMap(partsOf) : [element];
}

const dialogs = new Set(); // the newest open one is the last
let barred = [];

/** Bar what lies beside the open dialogs, and nothing else. */
function bar() {
  for (const part of barred) part.removeAttribute("inert");
  barred = [...dialogs].filter(({ open }) => open).flatMap(besideOf);
  for (const part of barred) part.setAttribute("inert", "");
}

/** Return the dialog that opened last and is still open. @returns {HTMLDialogElement | undefined} */
export function newestDialog() {
  return [...dialogs].filter(({ open }) => open).at(-1);
}

/** @param {HTMLDialogElement} dialog @param {AbortSignal} signal ends it */
export function barBeside(dialog, signal) {
  let before = null; // the element that had the focus
  let wasOpen = false;

  const follow = () => {
    if (dialog.open === wasOpen) return;
    wasOpen = dialog.open;
    dialogs.delete(dialog);
    dialogs.add(dialog);
    bar();
    if (wasOpen) return;
    // The browser could not give it back: the element was barred.
    const isLost = () => [document.body, null].includes(document.activeElement);
    if (isLost() || dialog.contains(document.activeElement)) before?.focus();
    if (isLost()) newestDialog()?.querySelector("[autofocus], button, input")?.focus();
    before = null;
  };
  dialogs.add(dialog);
  const observer = new MutationObserver(follow);
  observer.observe(dialog, { attributes: true, attributeFilter: ["open"] });
  const came = ({ relatedTarget }) => {
    if (relatedTarget && !dialog.contains(relatedTarget)) before = relatedTarget;
  };
  dialog.addEventListener("focusin", came, { signal });
  signal.addEventListener("abort", () => {
    observer.disconnect();
    dialogs.delete(dialog);
    bar();
  });
}
