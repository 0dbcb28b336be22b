/** Buttons that copy a field's text. They stay hidden without scripts. */

/**
 * Copies the text, or selects it if the browser offers no clipboard: on plain HTTP from another computer.
 * @param {HTMLButtonElement} button
 * @param {HTMLInputElement} field
 * @returns {Promise<boolean>} whether it is copied
 */
export async function copy(button, field) {
  let copied = true;
  try {
    await navigator.clipboard.writeText(field.value);
  } catch {
    copied = false;
    field.focus();
    field.select();
  }
  const words = copied ? button.dataset.copied : button.dataset.failed;
  button.textContent = words;
  const status = document.querySelector("[data-copy-status]");
  if (status) status.textContent = words;
  return copied;
}

for (const button of document.querySelectorAll("[data-copy]")) {
  button.hidden = false;
  button.addEventListener("click", () =>
    copy(button, document.getElementById(button.dataset.copy)),
  );
}
