/** Keeping, sharing and deleting a recording, for those who may. */

import { send } from "../connection/write.js";
import { setTextOrHide } from "../lib/dom.js";
import { question } from "../lib/question.js";

/** @param {Record<string, HTMLElement>} parts @param {string} address of the recording */
export function changes(parts, address) {
  if (!parts.change) return;
  const problem = parts["change-problem"];
  const change = async (method, path, body, then = () => location.reload()) => {
    try {
      await send(method, `${address}${path}`, body);
      then();
    } catch (error) {
      setTextOrHide(problem, error.message);
    }
  };
  parts.keep.addEventListener("click", () =>
    change("PUT", "/kept", { kept: parts.keep.dataset.kept !== "true" }),
  );
  parts.share.addEventListener("submit", (event) => {
    event.preventDefault();
    const { kind, name } = parts.share.elements;
    change("POST", "/shares", { [kind.value]: name.value.trim() });
  });
  for (const button of parts.change.querySelectorAll("[data-unshare]"))
    button.addEventListener("click", () =>
      change("DELETE", `/shares/${button.dataset.unshare}`, null),
    );
  const ask = question(parts["delete-dialog"], () =>
    change("DELETE", "", null, () => location.assign("/recordings/")),
  );
  parts.delete.addEventListener("click", () => ask.ask());
}
